//! Facts about one asset.

use serde::Deserialize;

use crate::geometry::Vec3;

/// Facts about one asset, from the catalogue that ships with evonav.
#[derive(Debug, Clone, PartialEq, Default)]
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
    /// Names of its materials, as ProcTHOR lists them; see [`crate::assets::Catalogue::material_colour`].
    pub materials: Vec<String>,
    /// What it is made of (`wood`, `metal`, `fabric` ...), the most important first; may be empty.
    pub made_of: Vec<String>,
    /// Split of ProcTHOR's dataset that it belongs to; `None` for those used in all.
    pub split: Option<Split>,
    /// Can be carried by a robot (AI2-THOR's `CanPickup`).
    pub is_pickupable: bool,
    /// Can be pushed (AI2-THOR's `Moveable`).
    pub is_moveable: bool,
    /// Holds other objects (AI2-THOR's `Receptacle`).
    pub is_receptacle: bool,
    /// Has doors, drawers or a lid (AI2-THOR's `CanOpen`).
    pub is_openable: bool,
}

/// A split of ProcTHOR's assets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Split {
    /// Training houses.
    Train,
    /// Validation houses.
    Val,
    /// Test houses.
    Test,
}
