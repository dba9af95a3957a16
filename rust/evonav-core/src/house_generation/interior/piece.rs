//! The pieces that stand on the floor of a room: single objects, and groups.

use crate::{
    assets::{Asset, placement_rule::Place},
    geometry::Vec3,
    house_generation::rectangle::Rectangle,
};

/// An object or an asset group on the floor.
#[derive(Debug, Clone)]
pub(in crate::house_generation) struct Piece {
    /// Kind of its place.
    pub place: Place,
    /// Floor that it takes, with the padding at walls.
    pub floor: Rectangle,
    /// The same floor with the floor that stays free in front of it or around it.
    pub margined: Rectangle,
    /// Its objects; an object comes after the one that it stands on.
    pub objects: Vec<PlacedObject>,
    /// Whether it is an asset group.
    pub is_group: bool,
}

/// An object at its place.
#[derive(Debug, Clone)]
pub(in crate::house_generation) struct PlacedObject {
    pub asset: &'static Asset,
    /// Centre of its box.
    pub position_m: Vec3,
    /// Unity Euler angles.
    pub rotation_deg: Vec3,
    /// Index in the piece of the object that it stands on.
    pub parent: Option<usize>,
    /// Openness, if it has one.
    pub openness: Option<f64>,
}

impl Piece {
    /// Return the height of its highest box.
    pub fn top_m(&self) -> f64 {
        let top = |object: &PlacedObject| object.position_m[1] + 0.5 * object.asset.size_m[1];
        self.objects.iter().map(top).fold(0.0, f64::max)
    }

    /// Return whether one of its objects is of a category.
    pub fn has(&self, category: &str) -> bool {
        self.objects.iter().any(|object| object.asset.category == category)
    }
}
