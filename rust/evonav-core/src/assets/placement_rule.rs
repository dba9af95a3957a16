//! Where a category is placed: ProcTHOR's placement annotations and observed receptacles.

use std::collections::HashMap;

use serde::Deserialize;

/// Where objects of one category stand, as ProcTHOR's annotators saw it.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
pub struct PlacementRule {
    /// Weight per room type (`Kitchen`, `LivingRoom`, `Bedroom`, `Bathroom`): 1 allowed, 2
    /// typical; see [`PlacementRule::room_weight`].
    #[serde(default)]
    rooms: HashMap<String, f64>,
    #[serde(default, rename = "where")]
    places: Vec<Place>,
    /// Fixed in place.
    pub is_kinematic: bool,
    /// Part of the building: doors and windows.
    pub is_structure: bool,
    /// Several may stand in one room.
    pub multiple_per_room: bool,
}

/// A part of a room where things stand.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Place {
    /// In a corner, against two walls.
    Corner,
    /// Away from walls.
    Middle,
    /// Along a wall.
    Edge,
    /// On the floor at all.
    Floor,
    /// Hung on a wall.
    Wall,
}

impl PlacementRule {
    /// 0 if the category is not placed in rooms of this type, else 1 or 2. Categories that no
    /// room mentions (sinks, televisions, paintings come with other things) are 0 everywhere.
    pub fn room_weight(&self, room_type: &str) -> f64 {
        self.rooms.get(room_type).copied().unwrap_or(0.0)
    }

    /// Whether `place` is marked.
    pub fn is_placed(&self, place: Place) -> bool {
        self.places.contains(&place)
    }
}
