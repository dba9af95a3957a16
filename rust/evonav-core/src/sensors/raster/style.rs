//! The ways in which colours are drawn.

use serde::{Deserialize, Serialize};

use crate::Error;

/// A way to draw colours. Depth and instances do not depend on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Style {
    /// Flat colours with dark corners, the cheapest.
    Plain,
    /// Lit surfaces with smooth edges, for detectors and models that know photographs.
    #[default]
    Default,
}

impl Style {
    /// All styles with their names.
    pub const NAMES: [(&str, Self); 2] = [("plain", Self::Plain), ("default", Self::Default)];

    /// Return the style of a name.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] if there is no such style.
    ///
    /// # Examples
    /// ```
    /// # use evonav_core::sensors::raster::Style;
    /// assert_eq!(Style::of("plain").unwrap(), Style::Plain);
    /// assert!(Style::of("cartoon").is_err());
    /// ```
    pub fn of(name: &str) -> Result<Self, Error> {
        let found = Self::NAMES.iter().find(|(known, _)| *known == name);
        let expected = Self::NAMES.map(|(known, _)| known).join(", ");
        found.map(|&(_, style)| style).ok_or_else(|| {
            Error::invalid("style", format!("{name:?}"), &format!("one of {expected}"))
        })
    }
}
