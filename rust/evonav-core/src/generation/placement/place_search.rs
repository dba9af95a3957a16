//! Where furniture can go: ProcTHOR's corner, edge and middle places on a room's floor.

use crate::{
    assets::placement_rule::Place,
    generation::placement::{
        movable_group::{Pose2, Rules, Unit},
        room_outline::{RoomPlan, WALL_GAP_M},
    },
    geometry::{Vec2, distance_2d_m, outline::is_within, polygon_contains},
    rng::Stream,
    world::{
        footprint::convex_hull,
        layout::{
            Layout, Placed, Placement,
            free_floor::{self, Floor},
            rounding::{ROUND_M, round_to},
        },
    },
};

/// Distance that furniture in the middle of a room keeps to its walls.
const MIDDLE_GAP_M: f64 = 0.35;
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
        let is_apart = |other: &Floor| !free_floor::overlap(reserve, other);
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
