//! Facts about one asset.

use serde::{Deserialize, Deserializer, Serialize};

use crate::geometry::Vec3;

/// Facts about one asset, from the catalogue that ships with evonav.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(default)]
pub struct Asset {
    /// Catalogue key, as in house files.
    pub id: String,
    /// ProcTHOR's object type, for example `DiningTable`.
    pub category: String,
    /// Size of the asset's box at zero yaw, `[x, y, z]`.
    pub size_m: Vec3,
    /// Heights above the box's bottom at which objects were recorded to stand, ascending; empty if
    /// there are none.
    pub surfaces_m: Vec<f64>,
    /// Colours (sRGB) of the asset's materials, most important first; may be empty.
    #[serde(deserialize_with = "read_colours")]
    pub colours: Vec<[u8; 3]>,
    /// Names of the asset's materials, as ProcTHOR lists them; see
    /// [`crate::assets::Catalogue::material_colour`].
    pub materials: Vec<String>,
    /// Substances (`wood`, `metal`, `fabric` ...) of the asset, most important first; may be empty.
    pub made_of: Vec<String>,
    /// Split of ProcTHOR's dataset to which the asset belongs; `None` for assets that all splits
    /// use.
    pub split: Option<Split>,
    /// Whether a robot can carry it (AI2-THOR's `CanPickup`).
    #[serde(rename = "pickupable")]
    pub is_pickupable: bool,
    /// Whether it can be pushed (AI2-THOR's `Moveable`).
    #[serde(rename = "moveable")]
    pub is_moveable: bool,
    /// Whether it can hold other objects (AI2-THOR's `Receptacle`).
    #[serde(rename = "receptacle")]
    pub is_receptacle: bool,
    /// Whether it has doors, drawers or a lid (AI2-THOR's `CanOpen`).
    #[serde(rename = "openable")]
    pub is_openable: bool,
}

fn read_colours<'de, D: Deserializer<'de>>(colours: D) -> Result<Vec<[u8; 3]>, D::Error> {
    Ok(Vec::<String>::deserialize(colours)?.iter().map(|hex| rgb(hex)).collect())
}

/// Parse a colour `rrggbb`; black if it is malformed.
pub(super) fn rgb(hex: &str) -> [u8; 3] {
    let [_, red, green, blue] = u32::from_str_radix(hex, 16).unwrap_or(0).to_be_bytes();
    [red, green, blue]
}

/// A split of ProcTHOR's assets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Split {
    /// Assets of training houses.
    Train,
    /// Assets of validation houses.
    Val,
    /// Assets of test houses.
    Test,
}
