//! Floor that stays free of furniture: in front of doors, along open-plan borders, and around
//! furniture.
//!
//! The lengths are those of the package `procthor` (`constants.MARGIN`, `doors.py`); 1,115 recorded
//! houses satisfy them.

use crate::{
    assets::placement_rule::Place,
    geometry::{Vec2, distance_2d_m, outline::overlap_m},
    house::{House, Opening},
    world::layout::contact::TOUCH_M,
};

/// Free depth in front of a door, on the side to which it does not open.
const ENTRANCE_M: f64 = 0.5;
/// Free depth beyond the leaf of an open door, and on both sides of a doorframe or open-plan
/// border.
const PASSAGE_M: f64 = 0.35;
/// Depth of a doorframe on the side to which a door would open.
const FRAME_M: f64 = 0.12;
/// Free depth in front of furniture with its back to a wall.
const FRONT_M: f64 = 0.5;
/// Free depth on all sides of furniture in the middle of a room.
const AROUND_M: f64 = 0.35;

/// A convex piece of floor, `[x, z]`.
pub type FloorPatch = [Vec2; 4];

/// Return the floor of a group of furniture: its box and the free floor around it.
///
/// # Arguments
/// * `low_m`, `high_m` - the box in the group's frame, which faces +z.
/// * `to_world` - transform from that frame to the world.
pub fn floor_around(
    anchor: Place,
    low_m: Vec2,
    high_m: Vec2,
    to_world: impl Fn(Vec2) -> Vec2,
) -> FloorPatch {
    let (sides, front) = match anchor {
        Place::Middle => (AROUND_M, AROUND_M),
        _ => (0.0, FRONT_M),
    };
    let back = if anchor == Place::Middle { AROUND_M } else { 0.0 };
    let (low, high) = ([low_m[0] - sides, low_m[1] - back], [high_m[0] + sides, high_m[1] + front]);
    [low, [high[0], low[1]], high, [low[0], high[1]]].map(to_world)
}

/// Return whether two pieces of floor share more than a border.
pub fn overlap(a: &FloorPatch, b: &FloorPatch) -> bool {
    overlap_m(a, b) > TOUCH_M
}

/// Return the floor on which no furniture may stand: on both sides of doors, where their leaves
/// move, and along borders between rooms that have no wall.
pub fn passages(house: &House) -> Vec<FloorPatch> {
    let doors = house.doors.iter().filter_map(|door| {
        let [near_m, far_m] = door_depths_m(door);
        let along_m = [door.hole_min_m[0], door.hole_max_m[0]];
        strip(house, &door.wall0, along_m, [-near_m, far_m])
    });
    let borders = house.walls.iter().filter(|wall| wall.is_empty).filter_map(|wall| {
        let along_m = [0.0, distance_2d_m(wall.from_m, wall.to_m)];
        strip(house, &wall.id, along_m, [-PASSAGE_M, PASSAGE_M])
    });
    doors.chain(borders).collect()
}

/// Return the depth of the free floor to the right of a door's first wall, and to the left, where
/// the door opens.
fn door_depths_m(door: &Opening) -> [f64; 2] {
    if door.asset_id.starts_with("Doorframe") {
        return [PASSAGE_M, PASSAGE_M + FRAME_M];
    }
    let num_leaves = if door.asset_id.contains("Double") { 2.0 } else { 1.0 };
    let leaf_m = (door.hole_max_m[0] - door.hole_min_m[0]) / num_leaves;
    [ENTRANCE_M, leaf_m + PASSAGE_M]
}

/// Return a rectangle given in a wall's frame, along it and across it to its left; `None` if the
/// wall does not exist.
fn strip(house: &House, wall_id: &str, along_m: Vec2, across_m: Vec2) -> Option<FloorPatch> {
    let wall = house.walls.iter().find(|wall| wall.id == wall_id)?;
    let length_m = distance_2d_m(wall.from_m, wall.to_m);
    let along = [0, 1].map(|i| (wall.to_m[i] - wall.from_m[i]) / length_m.max(1e-9));
    let at = |a: f64, c: f64| {
        [wall.from_m[0] + a * along[0] - c * along[1], wall.from_m[1] + a * along[1] + c * along[0]]
    };
    let ([from, to], [right, left]) = (along_m, across_m);
    Some([at(from, right), at(to, right), at(to, left), at(from, left)])
}
