//! What is known of ProcTHOR's assets, and the compound shapes that stand for them.

pub mod part;

use crate::geometry::Vec3;

/// Facts about one asset, from the catalogue that ships with evonav.
#[derive(Debug, Clone, PartialEq)]
pub struct Asset {
    /// Catalogue key, as in house files.
    pub id: String,
    /// ProcTHOR's object type, for example `DiningTable`.
    pub category: String,
    /// Size of its box at zero yaw, `[x, y, z]`.
    pub size_m: Vec3,
    /// Heights above its bottom at which things stand, rising; empty if nothing was seen on it.
    pub surfaces_m: Vec<f64>,
    /// Colours (sRGB) of its materials, most important first; may be empty.
    pub colours: Vec<[u8; 3]>,
    /// Can be carried by a robot (AI2-THOR's `CanPickup`).
    pub is_pickupable: bool,
    /// Holds other objects (AI2-THOR's `Receptacle`).
    pub is_receptacle: bool,
}
