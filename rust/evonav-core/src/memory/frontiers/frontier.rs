//! A frontier, and the parameters by which frontiers are found.

use std::f64::consts::TAU;

use crate::{Error, geometry::Vec2};

/// When free cells are a frontier, and where to look at it from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrontierConfig {
    /// Fewest cells of a region.
    pub min_cells: usize,
    /// When there is no such region, groups of at least so many unknown cells beside free ones are
    /// frontiers, each looked at from close by; 0 for never, as in 3D-Mem, where a glimpse of a
    /// room past a door is too small a region and the room stays undiscovered.
    pub min_border_cells: usize,
    /// A region that spans more than this, seen from the agent, is split.
    pub max_span_rad: f64,
    /// A view position keeps this far from obstacles where it can ...
    pub clearance_m: f64,
    /// ... by moving away from them in steps of this ...
    pub push_step_m: f64,
    /// ... this far at most.
    pub max_push_m: f64,
}

impl Default for FrontierConfig {
    fn default() -> Self {
        Self {
            min_cells: 20,
            min_border_cells: 3,
            max_span_rad: 150.0_f64.to_radians(),
            clearance_m: 0.5,
            push_step_m: 0.05,
            max_push_m: 0.3,
        }
    }
}

impl FrontierConfig {
    /// Check every field.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] naming the first field outside its domain.
    pub fn check(&self) -> Result<(), Error> {
        Error::require("max_span_rad", self.max_span_rad, "in [0.1, 2 pi]", |v| {
            (0.1..=TAU + 1e-9).contains(&v)
        })?;
        let is_length = |v: f64| v.is_finite() && v >= 0.0;
        Error::require("clearance_m", self.clearance_m, "finite and >= 0", is_length)?;
        Error::require("max_push_m", self.max_push_m, "finite and >= 0", is_length)?;
        Error::require("push_step_m", self.push_step_m, "finite and > 0", |v| {
            v.is_finite() && v > 0.0
        })
    }
}

/// A place to explore from.
#[derive(Debug, Clone, PartialEq)]
pub struct Frontier {
    /// Counts up; never used twice for one map.
    pub id: u64,
    /// `[x, z]` where to stand.
    pub position_m: Vec2,
    /// Where to look: from the agent, as it stood when the frontier was made, to the region; for
    /// the last resort ([`FrontierConfig::min_border_cells`]), from `position_m`.
    pub direction_rad: f64,
    /// `[row, col]` of the region, row-major.
    pub cells: Vec<[i32; 2]>,
}
