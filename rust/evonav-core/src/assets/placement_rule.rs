//! ProcTHOR's annotations of where a category is placed.

use std::collections::HashMap;

use serde::Deserialize;

/// Rooms and places in which objects of one category stand, by ProcTHOR's annotators.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
pub struct PlacementRule {
    /// Weight by room type (`Kitchen`, `LivingRoom`, `Bedroom`, `Bathroom`): 1 allowed, 2 typical;
    /// see [`PlacementRule::room_weight`].
    #[serde(default)]
    rooms: HashMap<String, f64>,
    #[serde(default, rename = "where")]
    places: Vec<Place>,
    /// Whether it is fixed in place.
    pub is_kinematic: bool,
    /// Whether it is part of the building: doors and windows.
    pub is_structure: bool,
    /// Whether several may stand in one room.
    pub multiple_per_room: bool,
}

/// A kind of place in a room.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Place {
    /// A corner, against two walls.
    Corner,
    /// The middle of the room, away from walls.
    Middle,
    /// The edge of the room, along a wall.
    Edge,
    /// The floor.
    Floor,
    /// A wall, for objects that hang.
    Wall,
}

impl PlacementRule {
    /// Return 0 if the category is not placed in rooms of this type, else 1 or 2. Categories
    /// without a room (sinks, televisions and paintings, which come with other objects) have 0
    /// everywhere.
    pub fn room_weight(&self, room_type: &str) -> f64 {
        self.rooms.get(room_type).copied().unwrap_or(0.0)
    }

    /// Return whether the annotations allow `place`.
    pub fn is_placed(&self, place: Place) -> bool {
        self.places.contains(&place)
    }
}
