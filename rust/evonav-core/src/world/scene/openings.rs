//! Fillings of the holes in walls: doors with frame and leaf, doorframes, windows.

use crate::{
    assets::{
        Asset,
        material::{Finish, Material, MaterialKind},
        part::Part,
        shapes::{Shape, is_pale, lit},
    },
    geometry::{Vec2, Vec3, add, compose, rotate, yaw_rotation},
    house::{House, Opening},
    world::scene::structure::WallFrame,
};

/// Largest width of the bars of a door frame or window frame.
const BAR_M: f64 = 0.05;
/// Half the depth of a door frame, about the wall's plane.
const FRAME_HALF_M: f64 = 0.05;
const LEAF_M: f64 = 0.035;
const WINDOW_HALF_M: f64 = 0.03;
const SKY: [u8; 3] = [190, 215, 235];

/// Build the frame and, for doors, the leaf, which is turned about its hinge by `openness` times 90
/// degrees.
///
/// The leaf opens to the left of `wall0` seen from its start, away from `wall0`'s room, where
/// ProcTHOR's generator leaves the floor free. Of 102 recorded positions within 1.6 m of a single
/// open door, 9 would be inside a leaf on the other side and none inside a leaf on this side.
/// Double doors have a leaf at each jamb. A single door has its hinge at the first jamb; neither
/// files nor positions show which one it is.
pub(crate) fn door_shape(
    house: &House,
    door: &Opening,
    asset: Option<&Asset>,
    is_glazed: bool,
) -> Shape {
    let Some((frame, along, up)) = hole(house, door) else { return Shape::default() };
    let colours = asset.map_or(&[][..], |asset| &asset.colours);
    let finish = |index: usize, otherwise: [u8; 3]| {
        let colour = colours.get(index).copied().unwrap_or(otherwise);
        let kind = if is_pale(colour) { MaterialKind::Smooth } else { MaterialKind::Wood };
        Finish { colour: lit(colour), material: Material::named(kind, &door.asset_id) }
    };
    let [wood, trim] = [finish(0, [150, 105, 70]), finish(1, [225, 220, 210])];
    let bar = BAR_M.min(0.1 * (along[1] - along[0]));
    let depth = [-FRAME_HALF_M, FRAME_HALF_M];
    let inner = [along[0] + bar, along[1] - bar];
    let head = up[1] - bar.min(0.1 * (up[1] - up[0]));
    let parts = vec![
        frame.cuboid([along[0], inner[0]], up, depth, trim),
        frame.cuboid([inner[1], along[1]], up, depth, trim),
        frame.cuboid(inner, [head, up[1]], depth, trim),
    ];
    let mut shape = Shape { parts, trim: Vec::new() };
    if door.asset_id.starts_with("Doorframe") {
        return shape;
    }
    let angle_rad = door.openness.clamp(0.0, 1.0) * std::f64::consts::FRAC_PI_2;
    let is_double = door.asset_id.contains("Double");
    let width = if is_double { 0.5 * (inner[1] - inner[0]) } else { inner[1] - inner[0] };
    let height = [up[0] + 0.005, head - 0.005];
    let hinges = [(inner[0], 1.0), (inner[1], -1.0)];
    for &(hinge, direction) in &hinges[..if is_double { 2 } else { 1 }] {
        let leaf = Leaf { frame: &frame, hinge, direction, width, up: height, angle_rad, wood };
        let mut parts = leaf.parts();
        if is_glazed {
            // The handle, number 1, is of metal.
            for index in [0, 2, 3] {
                parts[index].material.kind = MaterialKind::Pane;
            }
            shape.trim.extend(leaf.lattice());
        }
        shape.parts.extend(parts);
    }
    shape
}

/// Return whether a door's leaf is a frame with clear glass.
pub(super) fn is_glazed(asset: &Asset) -> bool {
    asset.materials.iter().any(|name| name.starts_with("Glass_Detailed_Tinted"))
}

/// A door's leaf. It is hinged at `hinge` and reaches along `direction` (1 or -1) when closed.
struct Leaf<'a> {
    frame: &'a WallFrame,
    hinge: f64,
    direction: f64,
    width: f64,
    up: Vec2,
    angle_rad: f64,
    wood: Finish,
}

impl Leaf<'_> {
    /// Return the span between two distances from the hinge.
    fn span(&self, from: f64, to: f64) -> Vec2 {
        let ends = [self.hinge + self.direction * from, self.hinge + self.direction * to];
        [ends[0].min(ends[1]), ends[0].max(ends[1])]
    }

    /// Turn a part of the closed leaf to where it is.
    fn turned(&self, part: Part) -> Part {
        let [x, z] = self.frame.point_m(self.hinge, FRAME_HALF_M);
        // Seen from above (x right, z up), a turn to the left is counter-clockwise: negative yaw.
        turned_about(part, [x, 0.0, z], &yaw_rotation(-self.direction * self.angle_rad))
    }

    /// Build a board with a handle and two raised panels.
    fn parts(&self) -> [Part; 4] {
        let Self { frame, width, up, wood, .. } = *self;
        let of = |kind| Material { kind, ..wood.material };
        let handle_up = (up[0] + 1.0).min(0.5 * (up[0] + up[1]));
        let depth = [FRAME_HALF_M - LEAF_M, FRAME_HALF_M];
        let board = frame.cuboid(self.span(0.0, width), up, depth, wood);
        let handle = frame.cuboid(
            self.span(width - 0.13, width - 0.05),
            [handle_up - 0.02, handle_up + 0.02],
            [depth[0] - 0.05, depth[1] + 0.05],
            Finish { colour: [190, 185, 170], material: of(MaterialKind::Metal) },
        );
        let raised = Finish {
            colour: wood.colour.map(|channel| (f64::from(channel) * 0.88).round() as u8),
            material: of(MaterialKind::Panel),
        };
        let panel = |from: f64, to: f64| {
            let height = up[1] - up[0];
            let level = [up[0] + from * height, up[0] + to * height];
            let depth = [depth[0] - 0.004, depth[1] + 0.004];
            frame.cuboid(self.span(0.2 * width, 0.8 * width), level, depth, raised)
        };
        [board, handle, panel(0.08, 0.42), panel(0.52, 0.93)].map(|part| self.turned(part))
    }

    /// Build the wood around and between the panes of a glazed leaf.
    fn lattice(&self) -> Vec<Part> {
        /// Widths of the wood at the sides and above, below, and between panes.
        const SIDE_M: f64 = 0.1;
        const FOOT_M: f64 = 0.2;
        const BAR_M: f64 = 0.024;
        /// Panes beside each other and over each other.
        const COLUMNS: u32 = 3;
        const ROWS: u32 = 5;
        let Self { width, up, wood, .. } = *self;
        let side_m = SIDE_M.min(0.2 * width);
        let [left, right] = [side_m, width - side_m];
        let [low, high] = [up[0] + FOOT_M.min(0.2 * (up[1] - up[0])), up[1] - side_m];
        let board = |from: f64, to: f64, level: Vec2, reach_m: f64| {
            let depth = [FRAME_HALF_M - LEAF_M - reach_m, FRAME_HALF_M + reach_m];
            self.turned(self.frame.cuboid(self.span(from, to), level, depth, wood))
        };
        let outer = |from: f64, to: f64, level: Vec2| board(from, to, level, 0.006);
        let mut parts = vec![
            outer(0.0, left, up),
            outer(right, width, up),
            outer(left, right, [up[0], low]),
            outer(left, right, [high, up[1]]),
        ];
        let half_m = 0.5 * BAR_M;
        for bar in 1..COLUMNS {
            let at = left + (right - left) * f64::from(bar) / f64::from(COLUMNS);
            parts.push(board(at - half_m, at + half_m, [low, high], 0.005));
        }
        for bar in 1..ROWS {
            let at = low + (high - low) * f64::from(bar) / f64::from(ROWS);
            parts.push(board(left, right, [at - half_m, at + half_m], 0.0045));
        }
        parts
    }
}

fn turned_about(part: Part, pivot_m: Vec3, turn: &[[f64; 3]; 3]) -> Part {
    let arm: Vec3 = std::array::from_fn(|i| part.centre_m[i] - pivot_m[i]);
    Part {
        centre_m: add(pivot_m, rotate(turn, arm)),
        rotation: compose(turn, &part.rotation),
        ..part
    }
}

/// Build the frame, crossbars and a pane; the pane is opaque and has the colour of the sky, since
/// nothing is outside.
pub(super) fn window_parts(house: &House, window: &Opening, asset: Option<&Asset>) -> Vec<Part> {
    let Some((frame, along, up)) = hole(house, window) else { return Vec::new() };
    let trim = asset.and_then(|asset| asset.colours.first().copied()).unwrap_or([235, 235, 230]);
    let of = |kind| Material::named(kind, &window.id);
    let trim = Finish { colour: lit(trim), material: of(MaterialKind::Smooth) };
    let pane = Finish { colour: SKY, material: of(MaterialKind::Outdoors) };
    let [width, height] = [along[1] - along[0], up[1] - up[0]];
    let bar = BAR_M.min(0.1 * width.min(height));
    let depth = [-WINDOW_HALF_M, WINDOW_HALF_M];
    let (inner, middle) = ([along[0] + bar, along[1] - bar], 0.5 * (along[0] + along[1]));
    let mut parts = vec![
        frame.cuboid([along[0], inner[0]], up, depth, trim),
        frame.cuboid([inner[1], along[1]], up, depth, trim),
        frame.cuboid(inner, [up[0], up[0] + bar], depth, trim),
        frame.cuboid(inner, [up[1] - bar, up[1]], depth, trim),
        frame.cuboid(inner, [up[0] + bar, up[1] - bar], depth.map(|d| 0.2 * d), pane),
    ];
    let bars = depth.map(|d| 0.6 * d);
    let half = 0.3 * bar;
    if width > 0.8 * height {
        let upright = [middle - half, middle + half];
        parts.push(frame.cuboid(upright, [up[0] + bar, up[1] - bar], bars, trim));
    }
    if height > 0.8 * width {
        let level = 0.5 * (up[0] + up[1]);
        parts.push(frame.cuboid(inner, [level - half, level + half], bars, trim));
    }
    parts
}

/// Return the wall's frame and the hole's spans along and up; `None` if the wall is unknown or the
/// hole empty.
fn hole(house: &House, opening: &Opening) -> Option<(WallFrame, Vec2, Vec2)> {
    let wall = house.walls.iter().find(|wall| wall.id == opening.wall0)?;
    let frame = WallFrame::of(wall)?;
    let along = [opening.hole_min_m[0], opening.hole_max_m[0]];
    let up = [opening.hole_min_m[1], opening.hole_max_m[1]];
    (along[1] - along[0] > 1e-3 && up[1] - up[0] > 1e-3).then_some((frame, along, up))
}
