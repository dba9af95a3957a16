//! Where furniture can go: ProcTHOR's corner, edge and middle places on a room's floor.

use super::{
    layout::{Layout, Placement},
    plan::{edges, is_within, point_segment_m},
};
use crate::{
    assets::placement::Place,
    geometry::{
        Vec2, add, distance_2d_m, polygon_area_m2, polygon_contains, rotate, sub, yaw_rotation,
    },
    house::{House, Room},
    rng::Stream,
};

/// Gap that ProcTHOR leaves between furniture and walls: exactly this in all recorded houses.
pub const WALL_GAP_M: f64 = 0.025;
/// Rounding of places, and so the slack of containment.
const ROUND_M: f64 = 1e-4;
/// Rounding of yaws.
const ROUND_DEG: f64 = 1e-3;
/// Distance that furniture in the middle of a room keeps to its walls.
const MIDDLE_GAP_M: f64 = 0.35;
/// A side this near a wall stands at it.
const AT_WALL_M: f64 = 0.15;
/// The floor of a room, as furniture sees it.
#[derive(Debug, Clone)]
pub struct RoomPlan {
    /// Outline `[x, z]`, interior on the left of each edge (x turns towards z).
    pub polygon_m: Vec<Vec2>,
    /// Whether edge `i`, from corner `i` on, is a wall along its whole length: not open plan.
    pub is_wall: Vec<bool>,
}

impl RoomPlan {
    /// The plan of one of the house's rooms.
    pub fn of(house: &House, room: &Room) -> Self {
        let mut polygon_m = room.polygon_m.clone();
        if polygon_area_m2(&polygon_m) < 0.0 {
            polygon_m.reverse();
        }
        let open: Vec<[Vec2; 2]> = house
            .walls
            .iter()
            .filter(|wall| wall.is_empty && wall.room_id == room.id)
            .map(|wall| [wall.from_m, wall.to_m])
            .collect();
        let is_open = |edge: [Vec2; 2]| {
            open.iter().any(|&[a, b]| {
                let middle = [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])];
                point_segment_m(middle, edge) < 0.01 && distance_2d_m(a, b) > 0.1
            })
        };
        let is_wall = edges(&polygon_m).map(|edge| !is_open(edge)).collect();
        Self { polygon_m, is_wall }
    }

    /// Edge `index`, from corner `index` on.
    fn edge(&self, index: usize) -> Edge {
        let from_m = self.polygon_m[index];
        let to_m = self.polygon_m[(index + 1) % self.polygon_m.len()];
        let length_m = distance_2d_m(from_m, to_m);
        let along = [0, 1].map(|i| (to_m[i] - from_m[i]) / length_m.max(f64::MIN_POSITIVE));
        Edge { from_m, along, inward: [-along[1], along[0]], length_m }
    }
}

/// One side of a room.
struct Edge {
    from_m: Vec2,
    /// Unit vector to its other end.
    along: Vec2,
    /// Unit normal into the room.
    inward: Vec2,
    length_m: f64,
}

/// Objects that move as one: furniture with what stands on it, or an asset group.
#[derive(Debug, Clone)]
pub struct Unit {
    /// All of them, the main one first.
    pub members: Vec<usize>,
    /// Those that stand on the floor.
    roots: Vec<usize>,
    /// Ways in which it may stand.
    anchors: Vec<Place>,
    /// Yaw of the unit's frame: its back is at -z.
    yaw_deg: f64,
    /// Box of the roots' outlines in that frame, about the main root's centre: `[x, z]`.
    min_m: Vec2,
    /// Largest corner.
    max_m: Vec2,
}

impl Unit {
    /// The roots and all that they bear.
    ///
    /// # Arguments
    /// * `roots` - the main one first; at least one.
    /// * `anchors` - ways in which it may stand; where empty, the way it stands now.
    pub fn new(layout: &Layout, roots: &[usize], anchors: &[Place], plan: &RoomPlan) -> Self {
        let members = roots.iter().flat_map(|&root| layout.with_supported(root)).collect();
        let main = &layout.items[roots[0]];
        let mut unit = Self {
            members,
            roots: roots.to_vec(),
            anchors: anchors.to_vec(),
            yaw_deg: main.placement.rotation_deg[1],
            min_m: [0.0; 2],
            max_m: [0.0; 2],
        };
        unit.measure(layout);
        if roots.len() > 1 || anchors.is_empty() {
            unit.turn_back_to_wall(layout, plan);
        }
        unit
    }

    /// Centre of the main root.
    fn pivot(&self, layout: &Layout) -> [f64; 3] {
        layout.items[self.roots[0]].placement.position_m
    }

    /// Sets the box for the present frame.
    fn measure(&mut self, layout: &Layout) {
        let pivot = self.pivot(layout);
        let into_frame = yaw_rotation(-self.yaw_deg.to_radians());
        self.min_m = [f64::INFINITY; 2];
        self.max_m = [f64::NEG_INFINITY; 2];
        for solid in self.roots.iter().flat_map(|&root| &layout.items[root].solids) {
            for p in &solid.outline_m {
                let local = rotate(&into_frame, [p[0] - pivot[0], 0.0, p[1] - pivot[2]]);
                for (axis, value) in [local[0], local[2]].into_iter().enumerate() {
                    self.min_m[axis] = self.min_m[axis].min(value);
                    self.max_m[axis] = self.max_m[axis].max(value);
                }
            }
        }
    }

    /// Takes the side at a wall as the back, and the number of such sides as the way it stands.
    ///
    /// A group has no annotation that house files keep; how it stands now is how it may stand.
    fn turn_back_to_wall(&mut self, layout: &Layout, plan: &RoomPlan) {
        let pivot = self.pivot(layout);
        let mut at_wall = Vec::new();
        for quarter in 0..4 {
            let mut turned = self.clone();
            turned.yaw_deg = self.yaw_deg + 90.0 * f64::from(quarter);
            turned.measure(layout);
            let from_frame = yaw_rotation(turned.yaw_deg.to_radians());
            let middle_x = 0.5 * (turned.min_m[0] + turned.max_m[0]);
            let back = add(rotate(&from_frame, [middle_x, 0.0, turned.min_m[1]]), pivot);
            let nearest_m = edges(&plan.polygon_m)
                .zip(&plan.is_wall)
                .filter(|(_, is_wall)| **is_wall)
                .map(|(edge, _)| point_segment_m([back[0], back[2]], edge))
                .fold(f64::INFINITY, f64::min);
            if nearest_m < AT_WALL_M {
                at_wall.push(turned);
            }
        }
        let anchor = match at_wall.len() {
            0 => Place::Middle,
            1 => Place::Edge,
            _ => Place::Corner,
        };
        if let Some(turned) = at_wall.into_iter().next() {
            *self = turned;
        }
        // What stands in a corner also stands at an edge.
        self.anchors = match anchor {
            Place::Corner => vec![Place::Corner, Place::Edge],
            other => vec![other],
        };
    }

    /// A random pose of the unit's frame in the room: `[x, z]` of the pivot, yaw in degrees, and
    /// the distance to keep from the room's border.
    fn sample_pose(&self, plan: &RoomPlan, stream: &mut Stream) -> Option<(Vec2, f64, f64)> {
        let anchor = *self.anchors.get(stream.below(self.anchors.len()))?;
        if anchor == Place::Middle {
            return sample_middle(plan, stream);
        }
        // Room along each wall for the unit's back.
        let width_m = self.max_m[0] - self.min_m[0];
        let slack: Vec<f64> = (0..plan.polygon_m.len())
            .map(|i| match plan.is_wall[i] {
                true => plan.edge(i).length_m - width_m - 2.0 * WALL_GAP_M,
                false => 0.0,
            })
            .collect();
        let index = stream.choose_weighted(&slack)?;
        let edge = plan.edge(index);
        // With its back to the wall, the unit's +x points along the edge.
        let near_m = WALL_GAP_M - self.min_m[0];
        let far_m = edge.length_m - WALL_GAP_M - self.max_m[0];
        let offset_m = if anchor == Place::Corner {
            let count = plan.polygon_m.len();
            let is_at_start = stream.below(2) == 0;
            let neighbour = (index + if is_at_start { count - 1 } else { 1 }) % count;
            if !plan.is_wall[neighbour] {
                return None;
            }
            if is_at_start { near_m } else { far_m }
        } else {
            near_m + stream.uniform() * (far_m - near_m)
        };
        let depth_m = WALL_GAP_M - self.min_m[1];
        let point =
            [0, 1].map(|i| edge.from_m[i] + offset_m * edge.along[i] + depth_m * edge.inward[i]);
        let yaw_deg = edge.inward[0].atan2(edge.inward[1]).to_degrees();
        Some((point, yaw_deg, WALL_GAP_M))
    }

    /// Draws a place for the unit in the room that is free, inside, and farther than `min_move_m`
    /// from where it is; `None` when this draw is not.
    pub fn sample_places(
        &self,
        layout: &Layout,
        plan: &RoomPlan,
        min_move_m: f64,
        stream: &mut Stream,
    ) -> Option<Vec<(usize, Placement)>> {
        let (point, yaw_deg, margin_m) = self.sample_pose(plan, stream)?;
        let pivot = self.pivot(layout);
        let point = point.map(|value| round_to(value, ROUND_M));
        if distance_2d_m(point, [pivot[0], pivot[2]]) <= min_move_m {
            return None;
        }
        let turn_deg = round_to(yaw_deg - self.yaw_deg, ROUND_DEG);
        let turn = yaw_rotation(turn_deg.to_radians());
        let moved = |&index: &usize| {
            let old = layout.items[index].placement;
            let offset = rotate(&turn, sub(old.position_m, pivot));
            let [x_deg, y_deg, z_deg] = old.rotation_deg;
            let placement = Placement {
                position_m: [
                    round_to(point[0] + offset[0], ROUND_M),
                    old.position_m[1],
                    round_to(point[1] + offset[2], ROUND_M),
                ],
                rotation_deg: [x_deg, turned_deg(y_deg + turn_deg), z_deg],
                parent: old.parent,
            };
            (index, placement)
        };
        let places: Vec<(usize, Placement)> = self.members.iter().map(moved).collect();
        let roots = places.iter().filter(|(index, _)| self.roots.contains(index));
        let is_inside = roots.into_iter().all(|(index, placement)| {
            let solids = layout.items[*index].solids_at(placement);
            let margin_m = margin_m - 3.0 * ROUND_M;
            solids.iter().all(|solid| is_within(&solid.outline_m, &plan.polygon_m, margin_m))
        });
        (is_inside && layout.is_clear(&places)).then_some(places)
    }
}

/// A random pose off the walls, square to the room's first edge.
fn sample_middle(plan: &RoomPlan, stream: &mut Stream) -> Option<(Vec2, f64, f64)> {
    let point = [0, 1].map(|axis| {
        let values = plan.polygon_m.iter().map(|p| p[axis]);
        let low = values.clone().fold(f64::INFINITY, f64::min);
        let high = values.fold(f64::NEG_INFINITY, f64::max);
        low + stream.uniform() * (high - low)
    });
    let along = plan.edge(0).along;
    let yaw_deg = along[0].atan2(along[1]).to_degrees() + 90.0 * stream.below(4) as f64;
    polygon_contains(&plan.polygon_m, point).then_some((point, yaw_deg, MIDDLE_GAP_M))
}

/// The nearest multiple of `step`: places are short decimals, the same on every machine.
pub(super) fn round_to(value: f64, step: f64) -> f64 {
    // Dividing by the reciprocal gives the decimal itself where multiplying by `step` does not.
    let per_unit = (1.0 / step).round();
    (value * per_unit).round() / per_unit
}

/// An angle in 0..360, rounded.
pub(super) fn turned_deg(angle_deg: f64) -> f64 {
    round_to(angle_deg.rem_euclid(360.0), ROUND_DEG) % 360.0
}
