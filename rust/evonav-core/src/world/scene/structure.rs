//! The structure of a house: floors, ceilings, and walls with their openings.
//!
//! ProcTHOR's walls are planes, one per side. Here each side is a slab of [`WALL_SIDE_M`] on its
//! room's side of the plane, so both sides have their own colour and a wall between two rooms is 1
//! cm thick. Slabs may not be much thicker: recorded agents come as close as 0.18 m to the planes,
//! and furniture stands 2 cm from them.

use crate::{
    assets::{
        material::Finish,
        part::{Part, Primitive},
    },
    geometry::{IDENTITY, Mat3, Vec2, distance_2d_m, outline::edges, polygon_contains},
    house::{House, Opening, Room, Wall},
};

/// Thickness of one side of a wall.
pub const WALL_SIDE_M: f64 = 0.005;
/// Thickness of floors (below y = 0) and ceilings (above the walls).
pub const SLAB_M: f64 = 0.02;
/// Height of rooms without any wall.
const DEFAULT_HEIGHT_M: f64 = 2.5;
/// Distance from one line within which two walls share their openings.
const SAME_PLANE_M: f64 = 0.02;
/// Depth of the steps that follow slanted edges of a floor; ProcTHOR's rooms have no such edges.
const STEP_M: f64 = 0.05;
/// Largest number of steps of a floor, so that a huge room costs no more than a small one.
const MAX_STEPS: f64 = 200.0;

/// A wall's own frame: origin at its foot's start, x along the foot, y up.
#[derive(Debug, Clone, Copy)]
pub(super) struct WallFrame {
    from_m: Vec2,
    /// Unit vector along the foot.
    along: Vec2,
    length_m: f64,
}

impl WallFrame {
    /// Create the frame of a wall; `None` for a wall without length.
    pub(super) fn of(wall: &Wall) -> Option<Self> {
        let length_m = distance_2d_m(wall.from_m, wall.to_m);
        (length_m > 1e-6).then(|| Self {
            from_m: wall.from_m,
            along: std::array::from_fn(|i| (wall.to_m[i] - wall.from_m[i]) / length_m),
            length_m,
        })
    }

    /// Return the unit normal to the left of the foot, seen from above (x right, z up).
    pub(super) fn left(&self) -> Vec2 {
        [-self.along[1], self.along[0]]
    }

    /// Return the ground point `along_m` from the start and `left_m` to the left.
    pub(super) fn point_m(&self, along_m: f64, left_m: f64) -> Vec2 {
        let left = self.left();
        std::array::from_fn(|i| self.from_m[i] + self.along[i] * along_m + left[i] * left_m)
    }

    /// Return `[along, left]` of a ground point.
    fn local_m(&self, point_m: Vec2) -> Vec2 {
        let [dx, dz] = [point_m[0] - self.from_m[0], point_m[1] - self.from_m[1]];
        let left = self.left();
        [dx * self.along[0] + dz * self.along[1], dx * left[0] + dz * left[1]]
    }

    /// Return the rotation that turns own x along the foot and own z to the left.
    pub(super) fn rotation(&self) -> Mat3 {
        let [x, z] = self.along;
        [[x, 0.0, -z], [0.0, 1.0, 0.0], [z, 0.0, x]]
    }

    /// Build a cuboid that spans `along`, `up` and `left` in this frame.
    pub(super) fn cuboid(&self, along: Vec2, up: Vec2, left: Vec2, finish: Finish) -> Part {
        let spans = [along, up, left];
        let [middle, half_m] = [0.5, -0.5].map(|sign| spans.map(|[a, b]| 0.5 * b + sign * a));
        let [x, z] = self.point_m(middle[0], middle[2]);
        Part {
            primitive: Primitive::Cuboid { half_m },
            centre_m: [x, middle[1], z],
            rotation: self.rotation(),
            colour: finish.colour,
            material: finish.material,
        }
    }
}

/// A rectangle cut out of a wall, in the wall's frame.
#[derive(Debug, Clone, Copy)]
struct Hole {
    along: Vec2,
    up: Vec2,
}

/// Openings with the ends of their holes on the ground plane, computed once per house.
pub(super) struct Openings<'a> {
    holes: Vec<(&'a Opening, [Vec2; 2])>,
}

impl<'a> Openings<'a> {
    pub(super) fn of(house: &'a House) -> Self {
        let place = |opening: &'a Opening| {
            let wall = house.walls.iter().find(|wall| wall.id == opening.wall0)?;
            let frame = WallFrame::of(wall)?;
            let ends = [opening.hole_min_m[0], opening.hole_max_m[0]];
            Some((opening, ends.map(|along_m| frame.point_m(along_m, 0.0))))
        };
        Self { holes: house.doors.iter().chain(&house.windows).filter_map(place).collect() }
    }

    /// Return the holes in a wall: its own, and those of walls in the same plane.
    fn cut_into(&self, frame: &WallFrame) -> Vec<Hole> {
        let local = |&(opening, ends): &(&Opening, [Vec2; 2])| {
            let [a, b] = ends.map(|end| frame.local_m(end));
            let is_here = a[1].abs() < SAME_PLANE_M && b[1].abs() < SAME_PLANE_M;
            let along = [a[0].min(b[0]).max(0.0), a[0].max(b[0]).min(frame.length_m)];
            let up = [opening.hole_min_m[1], opening.hole_max_m[1]];
            (is_here && along[0] < along[1]).then_some(Hole { along, up })
        };
        self.holes.iter().filter_map(local).collect()
    }
}

/// Build the slabs of one wall side, with openings cut out; none for open-plan walls.
pub(super) fn wall_parts(
    house: &House,
    wall: &Wall,
    openings: &Openings<'_>,
    finish: Finish,
) -> Vec<Part> {
    let Some(frame) = WallFrame::of(wall) else { return Vec::new() };
    if wall.is_empty || wall.height_m <= 0.0 {
        return Vec::new();
    }
    let left = side_of(house, wall, &frame);
    let holes = openings.cut_into(&frame);
    let mut parts = Vec::new();
    for [from, to] in intervals(0.0, frame.length_m, holes.iter().map(|hole| hole.along)) {
        let middle = 0.5 * (from + to);
        let here = holes.iter().filter(|hole| hole.along[0] < middle && middle < hole.along[1]);
        let cuts: Vec<Vec2> = here.map(|hole| hole.up).collect();
        for up in intervals(0.0, wall.height_m, cuts.iter().copied()) {
            let middle = 0.5 * (up[0] + up[1]);
            if !cuts.iter().any(|cut| cut[0] < middle && middle < cut[1]) {
                parts.push(frame.cuboid([from, to], up, left, finish));
            }
        }
    }
    parts
}

/// Cut `[low, high]` at both ends of each of `cuts`.
fn intervals(low: f64, high: f64, cuts: impl Iterator<Item = Vec2>) -> Vec<Vec2> {
    let mut marks: Vec<f64> = cuts.flatten().map(|mark| mark.clamp(low, high)).collect();
    marks.extend([low, high]);
    marks.sort_by(f64::total_cmp);
    marks.windows(2).filter(|pair| pair[1] - pair[0] > 1e-6).map(|p| [p[0], p[1]]).collect()
}

/// Return the place of a side's slab, `[from, to]` to the left of the plane: in its room, or
/// outside.
fn side_of(house: &House, wall: &Wall, frame: &WallFrame) -> Vec2 {
    let room = house.rooms.iter().find(|room| room.id == wall.room_id);
    let probe = |sign: f64| frame.point_m(0.5 * frame.length_m, sign * 0.01);
    let is_inside = |sign: f64| match room {
        Some(room) => polygon_contains(&room.polygon_m, probe(sign)),
        None => !house.rooms.iter().any(|room| polygon_contains(&room.polygon_m, probe(sign))),
    };
    match (is_inside(1.0), is_inside(-1.0)) {
        (true, false) => [0.0, WALL_SIDE_M],
        (false, true) => [-WALL_SIDE_M, 0.0],
        _ => [-0.5 * WALL_SIDE_M, 0.5 * WALL_SIDE_M],
    }
}

/// Return the height of a room: that of its tallest wall, or of the house's tallest wall.
pub(super) fn room_height_m(house: &House, room: &Room) -> f64 {
    let tallest = |walls: &mut dyn Iterator<Item = &Wall>| {
        walls.map(|wall| wall.height_m).fold(0.0, f64::max)
    };
    let own = tallest(&mut house.walls.iter().filter(|wall| wall.room_id == room.id));
    let any = if own > 0.0 { own } else { tallest(&mut house.walls.iter()) };
    if any > 0.0 { any } else { DEFAULT_HEIGHT_M }
}

/// Build slabs that cover a polygon between the heights `up`.
///
/// Exact for polygons with edges along x and z; a slanted edge is covered in steps, never less.
pub(super) fn slab_parts(polygon_m: &[Vec2], up: Vec2, finish: Finish) -> Vec<Part> {
    covering_rectangles(polygon_m)
        .into_iter()
        .map(|[x, z]| {
            let spans = [x, up, z];
            Part {
                primitive: Primitive::Cuboid { half_m: spans.map(|[a, b]| 0.5 * (b - a)) },
                centre_m: spans.map(|[a, b]| 0.5 * (a + b)),
                rotation: IDENTITY,
                colour: finish.colour,
                material: finish.material,
            }
        })
        .collect()
}

/// Cover a polygon with rectangles `[x, z]`, in bands between its corners' z.
fn covering_rectangles(polygon_m: &[Vec2]) -> Vec<[Vec2; 2]> {
    let mut marks: Vec<f64> = polygon_m.iter().map(|corner| corner[1]).collect();
    marks.sort_by(f64::total_cmp);
    marks.dedup_by(|a, b| *a - *b < 1e-6);
    let upwards = edges(polygon_m).map(|[a, b]| if a[1] < b[1] { [a, b] } else { [b, a] });
    let edges: Vec<[Vec2; 2]> = upwards.filter(|[a, b]| b[1] - a[1] > 1e-9).collect();
    let height_m = marks.last().zip(marks.first()).map_or(0.0, |(high, low)| high - low);
    let step_m = STEP_M.max(height_m / MAX_STEPS);
    let mut rectangles: Vec<[Vec2; 2]> = Vec::new();
    for band in marks.windows(2) {
        let is_across = |[a, b]: &&[Vec2; 2]| a[1] <= band[0] + 1e-7 && b[1] >= band[1] - 1e-7;
        let across: Vec<&[Vec2; 2]> = edges.iter().filter(is_across).collect();
        let is_slanted = across.iter().any(|[a, b]| (a[0] - b[0]).abs() > 1e-9);
        let num_steps =
            if is_slanted { ((band[1] - band[0]) / step_m).ceil().max(1.0) } else { 1.0 };
        for step in 0..num_steps as usize {
            let at = |k: f64| band[0] + (band[1] - band[0]) * k / num_steps;
            let z = [at(step as f64), at(step as f64 + 1.0)];
            let mut crossings: Vec<Vec2> = across
                .iter()
                .map(|[a, b]| {
                    let x = |z: f64| a[0] + (b[0] - a[0]) * (z - a[1]) / (b[1] - a[1]);
                    let (low, high) = (x(z[0]), x(z[1]));
                    [low.min(high), low.max(high)]
                })
                .collect();
            crossings.sort_by(|a, b| (a[0] + a[1]).total_cmp(&(b[0] + b[1])));
            for pair in crossings.chunks_exact(2) {
                push_merged(&mut rectangles, [[pair[0][0], pair[1][1]], z]);
            }
        }
    }
    rectangles
}

/// Add a rectangle, or lengthen one that ends where it begins.
fn push_merged(rectangles: &mut Vec<[Vec2; 2]>, new: [Vec2; 2]) {
    let [x, z] = new;
    if x[1] - x[0] <= 1e-9 {
        return;
    }
    let fits = |[old_x, old_z]: &&mut [Vec2; 2]| {
        (old_z[1] - z[0]).abs() < 1e-9
            && (old_x[0] - x[0]).abs() < 1e-9
            && (old_x[1] - x[1]).abs() < 1e-9
    };
    match rectangles.iter_mut().find(fits) {
        Some(old) => old[1][1] = z[1],
        None => rectangles.push(new),
    }
}
