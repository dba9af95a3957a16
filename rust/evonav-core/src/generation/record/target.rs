//! Records of a stage's target and of its description.

use serde::Serialize;

use crate::{assets::shapes::Detail, geometry::Vec3};

/// The target x_k.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TargetRecord {
    /// Object.
    pub id: String,
    /// Category of the object.
    pub category: String,
    /// Id of its room.
    pub room_id: String,
    /// Centre of its box.
    pub position_m: Vec3,
    /// Size of its box at zero yaw.
    pub size_m: Vec3,
    /// Id of the object that it stands on.
    pub support_id: Option<String>,
    /// Target score.
    pub score: f64,
    /// Ids of all other objects of its category.
    pub same_category_ids: Vec<String>,
    /// Whether this stage's change relocated it.
    pub is_relocated_now: bool,
    /// Whether any change so far relocated it.
    pub is_relocated_ever: bool,
}

/// The surroundings of a target, in categories (paper, Sec. A.4).
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Relations {
    /// Type of the target's room.
    pub room_type: String,
    /// Whether no other object of the house has its category.
    pub is_category_unique: bool,
    /// Whether no other room of the house is of its room's type.
    pub is_room_type_unique: bool,
    /// Object that it stands on or in.
    pub support: Option<Anchor>,
    /// Whether it is inside its support: in a basin, or behind a door.
    pub is_in_support: bool,
    /// Objects next to it, at most two, nearest first.
    pub neighbours: Vec<Anchor>,
    /// A `doorway`, `window` or `corner` near it.
    pub structure: Option<Anchor>,
    /// An object on the wall near it.
    pub wall_object: Option<Anchor>,
    /// Whether the wall object hangs above it.
    pub is_below_wall_object: bool,
    /// Number of objects of the house to which all of this applies, read literally; the target is
    /// one of them.
    pub num_fitting: usize,
}

/// An object or a part of a room to which an instruction refers.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Anchor {
    /// Category of the object, or the word for a part of the room.
    pub category: String,
    /// Determiner before the category.
    pub determiner: Determiner,
}

/// The determiner of an anchor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Determiner {
    /// The anchor is the only one of its category in the room.
    The,
    /// The anchor is one of several in the room.
    A,
    /// Two or more anchors of the category are next to the target.
    Some,
}

/// The appearance of a target.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Appearance {
    /// Colours visible in the reference image, largest share first.
    pub tints: Vec<Tint>,
    /// Form: `round`, `L-shaped` or `U-shaped`, if its category has other forms too.
    pub form: Option<&'static str>,
    /// Parts by which it can be recognised.
    pub details: Vec<Detail>,
    /// Substances of which it is made, most important first.
    pub made_of: Vec<String>,
}

/// A material's colour in an image.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Tint {
    /// Colour of the material, sRGB.
    pub colour: [u8; 3],
    /// Share of the target's pixels, 0..1.
    pub share: f64,
}
