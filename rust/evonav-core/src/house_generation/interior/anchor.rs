//! The place of a piece of furniture in a free rectangle: in a corner of the room, at its edge or
//! in its middle (`ProceduralRoom.sample_anchor_location` of the package `procthor`).

use crate::{
    assets::placement_rule::Place,
    geometry::{Vec2, outline::edges, polygon_contains},
    house_generation::{
        parameters::FloorObjects,
        rectangle::Rectangle,
        sampling::{choose, happens, uniform_in},
    },
    rng::Stream,
};

/// Distance at which the surroundings of a corner are probed.
const PROBE_M: f64 = 1e-3;
/// Distance from a line within which an edge lies on it.
const ON_LINE_M: f64 = 1e-6;
/// Distance from the edge of its rectangle at which a piece in the middle is kept, so that it does
/// not touch a wall, whose sides are 5 mm thick; ours.
const MIDDLE_INSET_M: f64 = 0.01;

/// A place in a rectangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Anchor {
    /// A corner of the room, and the direction into the room along x and z.
    Corner(Vec2, Vec2),
    /// An edge of the room, with the direction into the room.
    Edge(Vec2),
    /// Any place.
    Middle,
}

impl Anchor {
    /// Draw the place of the next piece in a free rectangle of a room.
    pub fn sample(
        rules: &FloorObjects,
        polygon_m: &[Vec2],
        rectangle: &Rectangle,
        stream: &mut Stream,
    ) -> Self {
        let Rectangle { low_m: [x0, z0], high_m: [x1, z1] } = *rectangle;
        let corners = [
            ([x0, z0], [1.0, 1.0]),
            ([x0, z1], [1.0, -1.0]),
            ([x1, z1], [-1.0, -1.0]),
            ([x1, z0], [-1.0, 1.0]),
        ];
        let of_room: Vec<Self> = corners
            .into_iter()
            .filter(|&(corner, _)| is_convex_corner(polygon_m, corner))
            .map(|(corner, inward)| Self::Corner(corner, inward))
            .collect();
        if let Some(&corner) = choose(stream, &of_room) {
            return corner;
        }
        let lines = [
            ([[x0, z0], [x1, z0]], [0.0, 1.0]),
            ([[x0, z0], [x0, z1]], [1.0, 0.0]),
            ([[x1, z0], [x1, z1]], [-1.0, 0.0]),
            ([[x0, z1], [x1, z1]], [0.0, -1.0]),
        ];
        let of_room: Vec<Self> = lines
            .into_iter()
            .filter(|(side, _)| is_on_outline(polygon_m, *side))
            .map(|(_, inward)| Self::Edge(inward))
            .collect();
        match choose(stream, &of_room) {
            Some(&edge) if happens(stream, rules.edge_probability) => edge,
            _ => Self::Middle,
        }
    }

    /// Return the kind of the place.
    pub fn place(&self) -> Place {
        match self {
            Self::Corner(..) => Place::Corner,
            Self::Edge(_) => Place::Edge,
            Self::Middle => Place::Middle,
        }
    }

    /// Return whether a piece must be turned so that its width is along z; `None` if both will do.
    pub fn must_turn(&self) -> Option<bool> {
        match self {
            Self::Edge(inward) => Some(inward[0] != 0.0),
            _ => None,
        }
    }

    /// Draw the floor and the yaw of a piece.
    ///
    /// # Arguments
    /// * `size_m` - edges of its box along x and z as it is turned.
    /// * `is_turned` - whether its width is along z.
    ///
    /// # Returns
    /// The floor with the padding at walls, and the yaw in degrees: the piece faces into the room.
    pub fn floor(
        &self,
        rules: &FloorObjects,
        rectangle: &Rectangle,
        size_m: Vec2,
        is_turned: bool,
        stream: &mut Stream,
    ) -> (Rectangle, f64) {
        let padding_m = rules.wall_padding_m;
        let free = |axis: usize| rectangle.size_m()[axis] - size_m[axis];
        match *self {
            Self::Corner(corner, inward) => {
                let far = [0, 1].map(|i| corner[i] + inward[i] * (size_m[i] + padding_m));
                let facing = if is_turned { [inward[0], 0.0] } else { [0.0, inward[1]] };
                (Rectangle::around(corner, far), yaw_deg(facing))
            }
            Self::Edge(inward) => {
                let across = usize::from(inward[0] == 0.0);
                let along = 1 - across;
                let start = rectangle.low_m[along] + uniform_in(stream, [0.0, free(along)]);
                let depth_m = size_m[across] + padding_m;
                let (mut low_m, mut high_m) = (rectangle.low_m, rectangle.high_m);
                (low_m[along], high_m[along]) = (start, start + size_m[along]);
                if inward[across] > 0.0 {
                    high_m[across] = low_m[across] + depth_m;
                } else {
                    low_m[across] = high_m[across] - depth_m;
                }
                (Rectangle { low_m, high_m }, yaw_deg(inward))
            }
            Self::Middle => {
                let low_m = [0, 1].map(|axis| {
                    let inset_m = MIDDLE_INSET_M.min(0.5 * free(axis).max(0.0));
                    let slack = [inset_m, (free(axis) - inset_m).max(inset_m)];
                    rectangle.low_m[axis] + uniform_in(stream, slack)
                });
                let high_m = [0, 1].map(|axis| low_m[axis] + size_m[axis]);
                let yaw_deg = [0.0, 180.0][stream.below(2)] + if is_turned { 90.0 } else { 0.0 };
                (Rectangle { low_m, high_m }, yaw_deg)
            }
        }
    }

    /// Return a piece's floor with the floor that stays free around it.
    pub fn margined(&self, rules: &FloorObjects, floor: &Rectangle, yaw_deg: f64) -> Rectangle {
        if *self == Self::Middle {
            return floor.grown([rules.middle_margin_m; 2], [rules.middle_margin_m; 2]);
        }
        let front_m = rules.front_margin_m;
        match (yaw_deg / 90.0).round() as i64 % 4 {
            0 => floor.grown([0.0; 2], [0.0, front_m]),
            1 => floor.grown([0.0; 2], [front_m, 0.0]),
            2 => floor.grown([0.0, front_m], [0.0; 2]),
            _ => floor.grown([front_m, 0.0], [0.0; 2]),
        }
    }
}

fn yaw_deg(facing: Vec2) -> f64 {
    match facing {
        [x, _] if x > 0.0 => 90.0,
        [x, _] if x < 0.0 => 270.0,
        [_, z] if z < 0.0 => 180.0,
        _ => 0.0,
    }
}

/// Return whether a point is a corner of the room in which a box fits: one of its four quarters is
/// inside, or two opposite ones.
fn is_convex_corner(polygon_m: &[Vec2], [x, z]: Vec2) -> bool {
    let quarter =
        |dx: f64, dz: f64| polygon_contains(polygon_m, [x + dx * PROBE_M, z + dz * PROBE_M]);
    let [a, b, c, d] =
        [quarter(1.0, 1.0), quarter(-1.0, 1.0), quarter(-1.0, -1.0), quarter(1.0, -1.0)];
    let is_diagonal = (a && c && !b && !d) || (b && d && !a && !c);
    is_diagonal || [a, b, c, d].iter().filter(|&&inside| inside).count() == 1
}

/// Return whether a line along an axis lies on the outline of the room.
fn is_on_outline(polygon_m: &[Vec2], line: [Vec2; 2]) -> bool {
    let along = usize::from(line[0][0] == line[1][0]);
    let across = 1 - along;
    let mut stretches: Vec<Vec2> = edges(polygon_m)
        .filter(|edge| edge.iter().all(|p| (p[across] - line[0][across]).abs() < ON_LINE_M))
        .map(|[a, b]| [a[along].min(b[along]), a[along].max(b[along])])
        .collect();
    stretches.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut covered_m = line[0][along];
    for [from, to] in stretches {
        if from <= covered_m + ON_LINE_M {
            covered_m = covered_m.max(to);
        }
    }
    covered_m >= line[1][along] - ON_LINE_M
}
