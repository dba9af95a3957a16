//! Check that the fields of a house agree with each other.

use std::collections::{HashMap, HashSet};

use crate::{
    Error,
    geometry::{Vec2, distance_2d_m, polygon_area_m2},
    house::{House, Opening, Room, Wall},
};

/// Length by which openings may extend beyond their wall: wall ends are rounded to millimetres.
const HOLE_TOLERANCE_M: f64 = 0.01;
/// Smallest area of a floor.
const MIN_AREA_M2: f64 = 0.01;
const MIN_WALL_M: f64 = 0.001;
/// Area of a triangle up to which its corners lie on one line.
const ON_LINE_M2: f64 = 1e-9;

/// Check ids, references, polygons and openings.
pub(super) fn check(house: &House) -> Result<(), Error> {
    if house.rooms.is_empty() {
        return Err(house.error("house", "rooms", "is empty, expected at least one room"));
    }
    check_ids(house)?;
    house.rooms.iter().try_for_each(|room| check_room(house, room))?;
    let rooms: HashSet<&str> = house.rooms.iter().map(|room| room.id.as_str()).collect();
    house.walls.iter().try_for_each(|wall| check_wall(house, wall, &rooms))?;
    let walls: HashMap<&str, &Wall> =
        house.walls.iter().map(|wall| (wall.id.as_str(), wall)).collect();
    let mut openings = house.doors.iter().chain(&house.windows);
    openings.try_for_each(|opening| check_opening(house, opening, &rooms, &walls))
}

/// Check that ids are unique among everything that can become a body of the scene.
fn check_ids(house: &House) -> Result<(), Error> {
    let mut seen = HashSet::new();
    let rooms = house.rooms.iter().map(|room| &room.id);
    let walls = house.walls.iter().map(|wall| &wall.id);
    let openings = house.doors.iter().chain(&house.windows).map(|opening| &opening.id);
    let objects = house.objects.iter().map(|object| &object.id);
    for id in rooms.chain(walls).chain(openings).chain(objects) {
        if !seen.insert(id.as_str()) {
            return Err(house.error(id, "id", &format!("{id:?} is used more than once")));
        }
    }
    Ok(())
}

fn check_room(house: &House, room: &Room) -> Result<(), Error> {
    let polygon_m = &room.polygon_m;
    let fail = |message: &str| Err(house.error(&room.id, "floorPolygon", message));
    if polygon_m.len() < 3 {
        return fail(&format!("has {} corners, expected at least 3", polygon_m.len()));
    }
    let area_m2 = polygon_area_m2(polygon_m).abs();
    if area_m2 < MIN_AREA_M2 {
        return fail(&format!("has an area of {area_m2} m2, expected at least {MIN_AREA_M2}"));
    }
    let num = polygon_m.len();
    let edge = |i: usize| [polygon_m[i], polygon_m[(i + 1) % num]];
    for i in 0..num {
        for j in i + 2..num {
            if (j + 1) % num != i && cross(edge(i), edge(j)) {
                return fail(&format!("edges {i} and {j} cross"));
            }
        }
    }
    Ok(())
}

/// Return whether two segments cross between their ends.
fn cross(a: [Vec2; 2], b: [Vec2; 2]) -> bool {
    let side = |[p, q]: [Vec2; 2], r: Vec2| polygon_area_m2(&[p, q, r]);
    // Ends on one line are a little beside it: their coordinates are rounded.
    let are_apart =
        |[one, other]: [f64; 2]| one.min(other) < -ON_LINE_M2 && one.max(other) > ON_LINE_M2;
    are_apart(b.map(|end| side(a, end))) && are_apart(a.map(|end| side(b, end)))
}

fn check_wall(house: &House, wall: &Wall, rooms: &HashSet<&str>) -> Result<(), Error> {
    if wall.room_id != super::EXTERIOR && !rooms.contains(wall.room_id.as_str()) {
        let message = format!("is {:?}, which is no room", wall.room_id);
        return Err(house.error(&wall.id, "roomId", &message));
    }
    let length_m = wall.length_m();
    if length_m < MIN_WALL_M {
        return Err(house.error(&wall.id, "polygon", &format!("wall is {length_m} m long")));
    }
    Ok(())
}

fn check_opening(
    house: &House,
    opening: &Opening,
    rooms: &HashSet<&str>,
    walls: &HashMap<&str, &Wall>,
) -> Result<(), Error> {
    for (field, room) in ["room0", "room1"].into_iter().zip(&opening.room_ids) {
        if !rooms.contains(room.as_str()) {
            return Err(house.error(&opening.id, field, &format!("is {room:?}, which is no room")));
        }
    }
    let wall_of = |field, id: &str| {
        let missing = || house.error(&opening.id, field, &format!("is {id:?}, which is no wall"));
        walls.get(id).copied().ok_or_else(missing)
    };
    let wall = wall_of("wall0", &opening.wall0)?;
    wall_of("wall1", &opening.wall1)?;
    let (low, high) = (opening.hole_min_m, opening.hole_max_m);
    let [length_m, height_m] = [wall.length_m(), wall.height_m];
    let fits = low[0] >= -HOLE_TOLERANCE_M
        && low[1] >= -HOLE_TOLERANCE_M
        && high[0] <= length_m + HOLE_TOLERANCE_M
        && high[1] <= height_m + HOLE_TOLERANCE_M;
    if !fits {
        let message = format!(
            "hole from {low:?} to {high:?} is off its wall {:?} of {length_m} x {height_m} m",
            wall.id
        );
        return Err(house.error(&opening.id, "holePolygon", &message));
    }
    Ok(())
}

impl Wall {
    /// Return the length of the foot.
    pub fn length_m(&self) -> f64 {
        distance_2d_m(self.from_m, self.to_m)
    }
}
