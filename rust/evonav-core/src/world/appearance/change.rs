//! The changes that make a random look.

use serde::Deserialize;

use crate::{Error, assets::Split};

/// A random look of a house: changes that are carried out one after another. Without changes it is
/// the house's own.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(transparent)]
pub struct Appearance {
    /// The changes, first to last.
    pub changes: Vec<Change>,
}

/// One random change. What it draws depends on its seed and on the names of what it changes, never
/// on the order of things or on other changes.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
pub enum Change {
    /// Floors, walls and ceilings get other materials that rooms have, and objects the materials of
    /// another asset of their category.
    Materials(Surfaces),
    /// Surfaces keep their materials and get any colours.
    Colors(Surfaces),
    /// The light in each room and the sun get another brightness and another colour. The last such
    /// change counts.
    Lighting(Lighting),
}

/// The surfaces that a change is about.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Surfaces {
    /// Seed of what is drawn.
    pub seed: u64,
    /// Categories of the bodies, as [`crate::world::scene::Body::category`]; `None` for all.
    pub categories: Option<Vec<String>>,
    /// Types of the rooms in which the bodies are, as [`crate::house::Room::room_type`]; `None` for
    /// everywhere.
    pub room_types: Option<Vec<String>>,
    /// Splits of ProcTHOR's assets that give materials, beside the assets that all splits use;
    /// `None` for all. Colours do not depend on it.
    pub splits: Option<Vec<Split>>,
}

/// Ranges of random light.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Lighting {
    /// Seed of what is drawn.
    pub seed: u64,
    /// Least and greatest factor of the brightness of lamps and sun.
    pub brightness: [f64; 2],
    /// Whether the colour changes too.
    pub randomize_color: bool,
    /// Least and greatest hue of the light, 0 to 1, where 0 and 1 are red.
    pub hue: [f64; 2],
    /// Least and greatest saturation of the light, 0 (white) to 1.
    pub saturation: [f64; 2],
    /// Whether all rooms and the sun get the same factor and colour.
    pub synchronized: bool,
}

impl Default for Lighting {
    fn default() -> Self {
        Self {
            seed: 0,
            brightness: [0.5, 1.5],
            randomize_color: true,
            hue: [0.0, 1.0],
            saturation: [0.0, 0.3],
            synchronized: false,
        }
    }
}

impl Appearance {
    /// Return the light's change, if there is one.
    pub fn lighting(&self) -> Option<&Lighting> {
        self.changes.iter().rev().find_map(|change| match change {
            Change::Lighting(lighting) => Some(lighting),
            _ => None,
        })
    }

    /// Read a list of changes and check their numbers.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] if the list is malformed, a list of names is empty, or a range is
    /// out of bounds.
    ///
    /// # Examples
    /// ```
    /// # use evonav_core::world::appearance::Appearance;
    /// let found = Appearance::from_json(r#"[{"kind": "materials", "seed": 3}]"#).unwrap();
    /// assert_eq!(found.changes.len(), 1);
    /// let wrong = Appearance::from_json(r#"[{"kind": "lighting", "hue": [0, 2]}]"#);
    /// assert!(wrong.unwrap_err().to_string().starts_with("argument `hue` is [0.0, 2.0]"));
    /// ```
    pub fn from_json(json: &str) -> Result<Self, Error> {
        let found: Self = serde_json::from_str(json)
            .map_err(|error| Error::invalid("changes", error, "a list of changes of a look"))?;
        for change in &found.changes {
            match change {
                Change::Materials(surfaces) | Change::Colors(surfaces) => surfaces.check()?,
                Change::Lighting(lighting) => lighting.check()?,
            }
        }
        Ok(found)
    }
}

impl Surfaces {
    fn check(&self) -> Result<(), Error> {
        let is_empty = |names: &Option<Vec<String>>| names.as_ref().is_some_and(Vec::is_empty);
        let lists = [("categories", &self.categories), ("room_types", &self.room_types)];
        match lists.into_iter().find(|(_, names)| is_empty(names)) {
            Some((name, _)) => {
                Err(Error::invalid(name, "[]", "at least one name, or none for all"))
            }
            None => Ok(()),
        }
    }
}

impl Lighting {
    fn check(&self) -> Result<(), Error> {
        let unit = |x: f64| (0.0..=1.0).contains(&x);
        let bright = |x: f64| (0.0..=100.0).contains(&x);
        in_range("brightness", self.brightness, "two numbers from 0 to 100", bright)?;
        in_range("hue", self.hue, "two numbers from 0 to 1", unit)?;
        in_range("saturation", self.saturation, "two numbers from 0 to 1", unit)
    }
}

fn in_range(
    name: &str,
    range: [f64; 2],
    expected: &str,
    is_valid: impl Fn(f64) -> bool,
) -> Result<(), Error> {
    if range.iter().all(|&end| is_valid(end)) {
        return Ok(());
    }
    Err(Error::invalid(name, format!("{range:?}"), expected))
}
