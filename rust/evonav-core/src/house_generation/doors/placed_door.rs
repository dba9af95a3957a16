//! A door in its wall.

use crate::{
    assets::OpeningSpace,
    house_generation::{
        parameters::Doors,
        rectangle::Rectangle,
        structure::{Side, Structure},
    },
};

/// A door or doorframe in a wall.
#[derive(Debug, Clone)]
pub(in crate::house_generation) struct PlacedDoor {
    /// Asset.
    pub space: &'static OpeningSpace,
    /// Index of the border that it is in.
    pub border: usize,
    /// Room of the wall in whose frame it is given; it opens away from this room.
    pub room: usize,
    /// Room on the other side; `None` for the outside.
    pub other: Option<usize>,
    /// Start of its box along that room's side of the border.
    pub start_m: f64,
}

impl PlacedDoor {
    /// Return whether it has no leaf.
    pub fn is_frame(&self) -> bool {
        self.space.id.starts_with("Doorframe")
    }

    /// Return the door as seen from the other room. The outside door stays as it is, since files
    /// give it in the frame of its room.
    pub fn flipped(&self, structure: &Structure) -> Self {
        let Some(other) = self.other else { return self.clone() };
        // Both sides list the same ends in opposite order.
        let start_m =
            structure.borders[self.border].length_m() - self.start_m - self.space.hole_m[0];
        Self { room: other, other: Some(self.room), start_m, ..self.clone() }
    }

    /// Return the floor that the door takes: its leaf, and `entrance_m` and `beyond_m` of free
    /// floor on the room's side and on the side to which it opens.
    pub fn floor(&self, structure: &Structure, [entrance_m, beyond_m]: [f64; 2]) -> Rectangle {
        let Some(side) = structure.side(self.room, self.border) else {
            return Rectangle { low_m: [0.0; 2], high_m: [0.0; 2] };
        };
        let along_m = [self.start_m, self.start_m + self.space.hole_m[0]];
        strip(&side, along_m, [-entrance_m, self.space.open_m[1] + beyond_m])
    }

    /// Return the free depths before and beyond the door.
    pub fn margins_m(&self, parameters: &Doors) -> [f64; 2] {
        match self.is_frame() {
            true => [parameters.open_margin_m; 2],
            false => [parameters.entrance_margin_m, parameters.leaf_margin_m],
        }
    }
}

/// Return the rectangle between two distances along a side, and two distances to its left.
pub(super) fn strip(side: &Side, along_m: [f64; 2], left_m: [f64; 2]) -> Rectangle {
    let [x, z] = side.along();
    let at = |along: f64, left: f64| {
        [side.from_m[0] + along * x - left * z, side.from_m[1] + along * z + left * x]
    };
    Rectangle::around(at(along_m[0], left_m[0]), at(along_m[1], left_m[1]))
}
