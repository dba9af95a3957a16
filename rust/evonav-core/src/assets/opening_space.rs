//! The space that doors and windows take.

use serde::Deserialize;

use crate::geometry::Vec2;

/// The space that the asset of a door, doorframe or window takes in a wall and in front of it.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OpeningSpace {
    /// Catalogue key of the asset.
    pub id: String,
    /// Edges of its box when it is open: along the wall, and across it.
    pub open_m: Vec2,
    /// Size of its hole in the wall, `[along, up]`.
    pub hole_m: Vec2,
    /// Position of the asset's middle relative to the middle of its box, `[along, up]`.
    pub offset_m: Vec2,
}
