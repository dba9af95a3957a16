//! The outline of a room's floor, and which of its edges are walls.

use crate::{
    geometry::{
        Vec2, distance_2d_m,
        outline::{edges, point_segment_m},
        polygon_area_m2,
    },
    house::{House, Room},
};

/// Gap between furniture and walls; ProcTHOR uses exactly this in all recorded houses.
pub const WALL_GAP_M: f64 = 0.025;
/// Largest distance of a side that stands at a wall.
pub const AT_WALL_M: f64 = 0.15;

/// The outline of a room's floor, and which of its edges are walls.
#[derive(Debug, Clone)]
pub struct RoomOutline {
    /// Outline `[x, z]`, interior on the left of each edge (x turns towards z).
    pub polygon_m: Vec<Vec2>,
    /// Whether edge `i`, which starts at corner `i`, is a wall along its whole length and not open
    /// plan.
    pub is_wall: Vec<bool>,
}

impl RoomOutline {
    /// Create the outline of one of the house's rooms.
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

    /// Return the distance of a point from the nearest wall.
    pub fn wall_distance_m(&self, point_m: Vec2) -> f64 {
        edges(&self.polygon_m)
            .zip(&self.is_wall)
            .filter(|(_, is_wall)| **is_wall)
            .map(|(edge, _)| point_segment_m(point_m, edge))
            .fold(f64::INFINITY, f64::min)
    }

    /// Return edge `index`, which starts at corner `index`.
    pub fn edge(&self, index: usize) -> Edge {
        let from_m = self.polygon_m[index];
        let to_m = self.polygon_m[(index + 1) % self.polygon_m.len()];
        let length_m = distance_2d_m(from_m, to_m);
        let along = [0, 1].map(|i| (to_m[i] - from_m[i]) / length_m.max(f64::MIN_POSITIVE));
        Edge { from_m, along, inward: [-along[1], along[0]], length_m }
    }
}

/// One side of a room.
pub struct Edge {
    pub from_m: Vec2,
    /// Unit vector to the other end.
    pub along: Vec2,
    /// Unit normal into the room.
    pub inward: Vec2,
    pub length_m: f64,
}
