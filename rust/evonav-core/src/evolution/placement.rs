//! Where furniture can go: ProcTHOR's corner, edge and middle places on a room's floor.

use crate::{
    assets::placement_rule::Place,
    evolution::{
        layout::{Layout, Placement},
        reserve::{self, Floor},
        unit::{Placed, ROUND_M, Unit},
    },
    geometry::{
        Vec2, distance_2d_m,
        outline::{edges, is_within, point_segment_m},
        polygon_area_m2, polygon_contains,
    },
    house::{House, Room},
    rng::Stream,
    world::footprint::convex_hull,
};

/// Gap that ProcTHOR leaves between furniture and walls: exactly this in all recorded houses.
pub const WALL_GAP_M: f64 = 0.025;
/// A side this near a wall stands at it.
pub const AT_WALL_M: f64 = 0.15;
/// Distance that furniture in the middle of a room keeps to its walls.
const MIDDLE_GAP_M: f64 = 0.35;
/// Rounding of yaws.
const ROUND_DEG: f64 = 1e-3;

/// The floor of a room, as furniture sees it.
#[derive(Debug, Clone)]
pub struct RoomPlan {
    /// Outline `[x, z]`, interior on the left of each edge (x turns towards z).
    pub polygon_m: Vec<Vec2>,
    /// Whether edge `i`, from corner `i` on, is a wall along its whole length: not open plan.
    pub is_wall: Vec<bool>,
}

/// A pose of a unit's frame.
#[derive(Debug, Clone, Copy)]
pub struct Pose2 {
    /// Centre of the unit's main object.
    pub point_m: Vec2,
    /// Yaw.
    pub yaw_deg: f64,
    /// How it stands there.
    pub anchor: Place,
}

/// How strictly ProcTHOR's rules are kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rules {
    /// Corner, edge or middle by the category, and free floor around.
    All,
    /// What stands in corners may also stand along walls, and with less than the free floor.
    Relaxed,
}

/// What a place is drawn for.
pub struct Search<'a> {
    /// Everything as it is.
    pub layout: &'a Layout,
    /// The room.
    pub plan: &'a RoomPlan,
    /// Floor that each of the room's units keeps ...
    pub reserves: &'a [Floor],
    /// ... and which of them is the unit's own.
    pub own: usize,
    /// Farther than this from where the unit is.
    pub min_move_m: f64,
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

    /// Distance of a point from the nearest wall.
    pub fn wall_distance_m(&self, point_m: Vec2) -> f64 {
        edges(&self.polygon_m)
            .zip(&self.is_wall)
            .filter(|(_, is_wall)| **is_wall)
            .map(|(edge, _)| point_segment_m(point_m, edge))
            .fold(f64::INFINITY, f64::min)
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

impl Search<'_> {
    /// Draws a place for a unit in the room that is free, inside, and far enough from where it is;
    /// `None` when this draw is not. With the place, the floor that the unit keeps there.
    pub fn draw(
        &self,
        unit: &Unit,
        rules: Rules,
        stream: &mut Stream,
    ) -> Option<(Vec<Placed>, Floor)> {
        let mut pose = self.sample_pose(unit, rules, stream)?;
        pose.point_m = pose.point_m.map(|value| round_to(value, ROUND_M));
        if distance_2d_m(pose.point_m, unit.centre_m()) <= self.min_move_m {
            return None;
        }
        let reserve = unit.reserve_at(&pose);
        if rules == Rules::All && !self.is_spacious(&reserve) {
            return None;
        }
        let placed = unit.placed_at(&pose);
        let is_free = self.is_inside(&placed, pose.anchor) && self.layout.is_free(&placed);
        is_free.then_some((placed, reserve))
    }

    /// Whether a unit with the floor around it fits between the room's walls, doors and all else.
    fn is_spacious(&self, reserve: &Floor) -> bool {
        let is_apart = |other: &Floor| !reserve::overlap(reserve, other);
        let mut others = self.reserves.iter().enumerate().filter(|(unit, _)| *unit != self.own);
        others.all(|(_, other)| is_apart(other))
            && self.layout.passages().iter().all(is_apart)
            && is_within(reserve, &self.plan.polygon_m, 0.0)
    }

    /// Whether all that stands on the floor is in the room, off its border.
    fn is_inside(&self, placed: &[Placed], anchor: Place) -> bool {
        let gap_m = if anchor == Place::Middle { MIDDLE_GAP_M } else { WALL_GAP_M };
        let polygon_m = &self.plan.polygon_m;
        let is_in = |outline: &[Vec2]| is_within(outline, polygon_m, gap_m - 3.0 * ROUND_M);
        placed.iter().filter(|member| member.is_root).all(|member| {
            let corners = member.solids.iter().flat_map(|solid| solid.outline_m.iter().copied());
            // In a rectangle the parts are inside if and only if their hull is.
            is_in(&convex_hull(corners.collect()))
                || (polygon_m.len() > 4
                    && member.solids.iter().all(|solid| is_in(&solid.outline_m)))
        })
    }

    /// A random pose of the unit's frame in the room.
    fn sample_pose(&self, unit: &Unit, rules: Rules, stream: &mut Stream) -> Option<Pose2> {
        let plan = self.plan;
        let anchors = unit.anchors(rules);
        let mut anchor = *anchors.get(stream.below(anchors.len()))?;
        if anchor == Place::Middle {
            return self.sample_middle(stream);
        }
        if rules == Rules::Relaxed && !anchors.contains(&Place::Edge) && stream.below(2) == 0 {
            anchor = Place::Edge;
        }
        // Room along each wall for the unit's back.
        let width_m = unit.max_m[0] - unit.min_m[0];
        let slack: Vec<f64> = (0..plan.polygon_m.len())
            .map(|i| match plan.is_wall[i] {
                true => plan.edge(i).length_m - width_m - 2.0 * WALL_GAP_M,
                false => 0.0,
            })
            .collect();
        let index = stream.choose_weighted(&slack)?;
        let edge = plan.edge(index);
        // With its back to the wall, the unit's +x points along the edge.
        let near_m = WALL_GAP_M - unit.min_m[0];
        let far_m = edge.length_m - WALL_GAP_M - unit.max_m[0];
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
        let depth_m = WALL_GAP_M - unit.min_m[1];
        let point_m =
            [0, 1].map(|i| edge.from_m[i] + offset_m * edge.along[i] + depth_m * edge.inward[i]);
        let yaw_deg = edge.inward[0].atan2(edge.inward[1]).to_degrees();
        Some(Pose2 { point_m, yaw_deg, anchor })
    }

    /// A random pose off the walls, square to the room's first edge.
    fn sample_middle(&self, stream: &mut Stream) -> Option<Pose2> {
        let polygon_m = &self.plan.polygon_m;
        let point_m = [0, 1].map(|axis| {
            let values = polygon_m.iter().map(|p| p[axis]);
            let low = values.clone().fold(f64::INFINITY, f64::min);
            let high = values.fold(f64::NEG_INFINITY, f64::max);
            low + stream.uniform() * (high - low)
        });
        let along = self.plan.edge(0).along;
        let yaw_deg = along[0].atan2(along[1]).to_degrees() + 90.0 * stream.below(4) as f64;
        let pose = Pose2 { point_m, yaw_deg, anchor: Place::Middle };
        polygon_contains(polygon_m, point_m).then_some(pose)
    }
}

/// Where the members went.
pub fn placements(placed: &[Placed]) -> Vec<(usize, Placement)> {
    placed.iter().map(|member| (member.index, member.placement)).collect()
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
