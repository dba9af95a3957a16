//! Search for free places of furniture: ProcTHOR's corner, edge and middle places on a room's
//! floor.

use crate::{
    assets::placement_rule::Place,
    generation::placement::{
        movable_group::{FramePose, MovableGroup, Rules},
        room_outline::{RoomOutline, WALL_GAP_M},
    },
    geometry::{Vec2, bounds_2d_m, distance_2d_m, outline::is_within, polygon_contains},
    rng::Stream,
    world::{
        footprint::convex_hull,
        layout::{
            Layout, PlacedItem, Placement,
            free_floor::{self, FloorPatch},
            rounding::{ROUND_M, round_to},
        },
    },
};

/// Smallest distance of furniture in the middle of a room from its walls.
const MIDDLE_GAP_M: f64 = 0.35;
/// The context of a search for places.
pub struct PlaceSearch<'a> {
    /// The present layout.
    pub layout: &'a Layout,
    /// The room.
    pub outline: &'a RoomOutline,
    /// Floor of each of the room's groups.
    pub floors: &'a [FloorPatch],
    /// Index in `floors` of the searched group itself.
    pub own: usize,
    /// Distance that the new place must exceed from the present one.
    pub min_move_m: f64,
}

impl PlaceSearch<'_> {
    /// Draw a place for a group; return it with the group's floor there. `None` if the drawn place
    /// is not free, not inside the room, or too near to the present place.
    pub fn draw(
        &self,
        group: &MovableGroup,
        rules: Rules,
        stream: &mut Stream,
    ) -> Option<(Vec<PlacedItem>, FloorPatch)> {
        let mut pose = self.sample_pose(group, rules, stream)?;
        pose.point_m = pose.point_m.map(|value| round_to(value, ROUND_M));
        if distance_2d_m(pose.point_m, group.centre_m()) <= self.min_move_m {
            return None;
        }
        let floor = group.floor_at(&pose);
        if rules == Rules::All && !self.is_spacious(&floor) {
            return None;
        }
        let placed = group.placed_at(&pose);
        let is_free = self.is_inside(&placed, pose.anchor) && self.layout.is_free(&placed);
        is_free.then_some((placed, floor))
    }

    /// Return whether a group's floor fits between the room's walls, doors and all other groups.
    fn is_spacious(&self, floor: &FloorPatch) -> bool {
        let is_apart = |other: &FloorPatch| !free_floor::overlap(floor, other);
        let mut others = self.floors.iter().enumerate().filter(|(group, _)| *group != self.own);
        others.all(|(_, other)| is_apart(other))
            && self.layout.passages().iter().all(is_apart)
            && is_within(floor, &self.outline.polygon_m, 0.0)
    }

    /// Return whether all members on the floor are in the room, away from its border.
    fn is_inside(&self, placed: &[PlacedItem], anchor: Place) -> bool {
        let gap_m = if anchor == Place::Middle { MIDDLE_GAP_M } else { WALL_GAP_M };
        let polygon_m = &self.outline.polygon_m;
        let is_in = |outline: &[Vec2]| is_within(outline, polygon_m, gap_m - 3.0 * ROUND_M);
        placed.iter().filter(|member| member.is_root).all(|member| {
            let corners = member.solids.iter().flat_map(|solid| solid.outline_m.iter().copied());
            // In a rectangle the parts are inside if and only if their hull is.
            is_in(&convex_hull(corners.collect()))
                || (polygon_m.len() > 4
                    && member.solids.iter().all(|solid| is_in(&solid.outline_m)))
        })
    }

    /// Draw a random pose of the group's frame in the room.
    fn sample_pose(
        &self,
        group: &MovableGroup,
        rules: Rules,
        stream: &mut Stream,
    ) -> Option<FramePose> {
        let outline = self.outline;
        let anchors = group.anchors(rules);
        let mut anchor = *anchors.get(stream.below(anchors.len()))?;
        if anchor == Place::Middle {
            return self.sample_middle(stream);
        }
        if rules == Rules::Relaxed && !anchors.contains(&Place::Edge) && stream.below(2) == 0 {
            anchor = Place::Edge;
        }
        // Free length along each wall for the group's back.
        let width_m = group.max_m[0] - group.min_m[0];
        let slack: Vec<f64> = (0..outline.polygon_m.len())
            .map(|i| match outline.is_wall[i] {
                true => outline.edge(i).length_m - width_m - 2.0 * WALL_GAP_M,
                false => 0.0,
            })
            .collect();
        let index = stream.choose_weighted(&slack)?;
        let edge = outline.edge(index);
        // With its back to the wall, the group's +x points along the edge.
        let near_m = WALL_GAP_M - group.min_m[0];
        let far_m = edge.length_m - WALL_GAP_M - group.max_m[0];
        let offset_m = if anchor == Place::Corner {
            let count = outline.polygon_m.len();
            let is_at_start = stream.below(2) == 0;
            let neighbour = (index + if is_at_start { count - 1 } else { 1 }) % count;
            if !outline.is_wall[neighbour] {
                return None;
            }
            if is_at_start { near_m } else { far_m }
        } else {
            near_m + stream.uniform() * (far_m - near_m)
        };
        let depth_m = WALL_GAP_M - group.min_m[1];
        let point_m =
            [0, 1].map(|i| edge.from_m[i] + offset_m * edge.along[i] + depth_m * edge.inward[i]);
        let yaw_deg = edge.inward[0].atan2(edge.inward[1]).to_degrees();
        Some(FramePose { point_m, yaw_deg, anchor })
    }

    /// Draw a random pose away from the walls, square to the room's first edge.
    fn sample_middle(&self, stream: &mut Stream) -> Option<FramePose> {
        let polygon_m = &self.outline.polygon_m;
        let [low, high] = bounds_2d_m(polygon_m.iter().copied());
        let point_m = [0, 1].map(|axis| low[axis] + stream.uniform() * (high[axis] - low[axis]));
        let along = self.outline.edge(0).along;
        let yaw_deg = along[0].atan2(along[1]).to_degrees() + 90.0 * stream.below(4) as f64;
        let pose = FramePose { point_m, yaw_deg, anchor: Place::Middle };
        polygon_contains(polygon_m, point_m).then_some(pose)
    }
}

/// Return the indices and places of the members.
pub fn placements(placed: &[PlacedItem]) -> Vec<(usize, Placement)> {
    placed.iter().map(|member| (member.index, member.placement)).collect()
}
