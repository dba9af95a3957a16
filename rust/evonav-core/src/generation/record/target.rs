//! The target of a stage, and what an instruction may say of it.

use serde::Serialize;

use crate::{assets::shapes::Detail, geometry::Vec3};

/// x_k.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TargetRecord {
    /// Object.
    pub id: String,
    /// Its category.
    pub category: String,
    /// Its room.
    pub room_id: String,
    /// Centre of its box.
    pub position_m: Vec3,
    /// Size of its box at zero yaw.
    pub size_m: Vec3,
    /// What it stands on.
    pub support_id: Option<String>,
    /// Target score.
    pub score: f64,
    /// Others of its category.
    pub same_category_ids: Vec<String>,
    /// By this stage's change.
    pub is_relocated_now: bool,
    /// By any change so far.
    pub is_relocated_ever: bool,
}

/// What surrounds a target, in categories (paper, Sec. A.4).
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Relations {
    /// Type of its room.
    pub room_type: String,
    /// Whether no other object of the house has its category.
    pub is_category_unique: bool,
    /// Whether no other room of the house is of its room's type.
    pub is_room_type_unique: bool,
    /// What it stands on or in.
    pub support: Option<Anchor>,
    /// Whether it is in its support: in a basin, or behind a door.
    pub is_in_support: bool,
    /// At most two things next to it, nearest first.
    pub neighbours: Vec<Anchor>,
    /// `doorway`, `window` or `corner` near it.
    pub structure: Option<Anchor>,
    /// Something on the wall near it.
    pub wall_object: Option<Anchor>,
    /// Whether that hangs above it.
    pub is_below_wall_object: bool,
    /// Objects of the house that all of this fits, read literally; the target is one.
    pub num_fitting: usize,
}

/// A thing that an instruction refers to.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Anchor {
    /// Its category, or the word for a part of the room.
    pub category: String,
    /// Which of its category.
    pub determiner: Determiner,
}

/// How a thing is referred to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Determiner {
    /// The only one in the room.
    The,
    /// One of several in the room.
    A,
    /// Two or more that are all next to the target.
    Some,
}

/// What a target looks like.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Appearance {
    /// Colours that show in the reference image, the largest share first.
    pub tints: Vec<Tint>,
    /// `round`, `L-shaped` or `U-shaped`, where its category has other forms too.
    pub form: Option<&'static str>,
    /// Parts by which it can be told.
    pub details: Vec<Detail>,
    /// What it is made of, the most important first.
    pub made_of: Vec<String>,
}

/// A material's colour in an image.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Tint {
    /// Of the material, sRGB.
    pub colour: [u8; 3],
    /// Of the target's pixels, 0..1.
    pub share: f64,
}
