//! A frontier, and the parameters by which frontiers are found.

use std::f64::consts::TAU;

use crate::{Error, geometry::Vec2};

/// Parameters of frontiers and of their view positions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrontierConfig {
    /// Smallest number of cells of a region.
    pub min_cells: usize,
    /// Smallest number of unknown cells beside free ones that form a frontier when there is no
    /// region; it is viewed from close by. 0 disables this, as in 3D-Mem, where a room that is
    /// barely visible through a door is too small a region and stays undiscovered.
    pub min_border_cells: usize,
    /// Largest angle that a region spans, seen from the agent; wider regions are split.
    pub max_span_rad: f64,
    /// Preferred distance of a view position from obstacles.
    pub clearance_m: f64,
    /// Length of the steps by which a view position moves away from obstacles.
    pub push_step_m: f64,
    /// Largest distance by which a view position moves.
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
    /// Id: ascending, never used twice for one map.
    pub id: u64,
    /// View position, `[x, z]`.
    pub position_m: Vec2,
    /// Viewing direction: from the agent's position when the frontier was created to the region;
    /// from `position_m` for frontiers by [`FrontierConfig::min_border_cells`].
    pub direction_rad: f64,
    /// Cells `[row, col]` of the region, row-major.
    pub cells: Vec<[i32; 2]>,
    /// Rows and columns of the cells.
    pub(crate) span: Span,
}

/// The rows and columns of some cells, the last included.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Span {
    pub(crate) low: [i32; 2],
    pub(crate) high: [i32; 2],
}

impl Span {
    pub(super) fn of(cells: &[[i32; 2]]) -> Self {
        let (mut low, mut high) = ([i32::MAX; 2], [i32::MIN; 2]);
        for cell in cells {
            low = [low[0].min(cell[0]), low[1].min(cell[1])];
            high = [high[0].max(cell[0]), high[1].max(cell[1])];
        }
        Self { low, high }
    }

    pub(crate) fn meets(&self, other: &Self) -> bool {
        (0..2).all(|i| self.low[i] <= other.high[i] && other.low[i] <= self.high[i])
    }
}
