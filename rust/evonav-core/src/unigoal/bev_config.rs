//! Parameters of the bird's-eye map.

use crate::{Error, geometry::Vec2, grid::MAX_CELLS};

/// Parameters of a [`BevMap`](crate::unigoal::bev_map::BevMap); the defaults are UniGoal's
/// constants.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BevConfig {
    /// Edge length of the map.
    pub size_m: f64,
    /// Edge length of a cell and of a voxel.
    pub cell_m: f64,
    /// Depth and width of the block of voxels in front of the camera.
    pub block_m: f64,
    /// Heights `[lowest, highest]` of the block over the floor.
    pub heights_m: Vec2,
    /// Smallest height of an obstacle.
    pub obstacle_min_m: f64,
    /// Largest height of an obstacle above the camera.
    pub obstacle_above_camera_m: f64,
    /// Largest depth that counts as a measurement.
    pub max_depth_m: f64,
    /// Spacing of the pixels that are used, along rows and columns.
    pub stride_px: usize,
    /// Number of points of a category in a cell that make the category certain.
    pub category_points: u8,
}

impl Default for BevConfig {
    fn default() -> Self {
        Self {
            size_m: 36.0,
            cell_m: 0.05,
            block_m: 5.0,
            heights_m: [-0.8, 3.6],
            obstacle_min_m: 0.35,
            obstacle_above_camera_m: 0.01,
            max_depth_m: 29.7,
            stride_px: 2,
            category_points: 5,
        }
    }
}

impl BevConfig {
    /// Check the values.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] naming the first field outside its domain.
    pub fn check(&self) -> Result<(), Error> {
        let is_length = |v: f64| v.is_finite() && v > 0.0;
        Error::require("cell_m", self.cell_m, "finite and > 0", is_length)?;
        Error::require("size_m", self.size_m, "finite and > 0", is_length)?;
        Error::require("max_depth_m", self.max_depth_m, "finite and > 0", is_length)?;
        let num_cells = (self.size_m / self.cell_m).powi(2);
        Error::require("size_m / cell_m", num_cells.sqrt(), "at most 8192 cells", |n| {
            n * n <= MAX_CELLS as f64
        })?;
        Error::require("block_m", self.block_m, "10 to 160 cells", |v| {
            (10.0..=160.0).contains(&(v / self.cell_m))
        })?;
        let [low, high] = self.heights_m;
        Error::require("heights_m[0]", low, "finite and <= 0", |v| v.is_finite() && v <= 0.0)?;
        Error::require("heights_m[1]", high, "at most 250 cells over heights_m[0]", |v| {
            v > 0.0 && (v - low) / self.cell_m <= 250.0
        })?;
        Error::require("obstacle_min_m", self.obstacle_min_m, "> 0 and below heights_m[1]", |v| {
            v > 0.0 && v < high
        })?;
        Error::require(
            "obstacle_above_camera_m",
            self.obstacle_above_camera_m,
            "finite",
            f64::is_finite,
        )?;
        Error::require("stride_px", self.stride_px, "at least 1", |n| n > 0)?;
        Error::require("category_points", self.category_points, "at least 1", |n| n > 0)
    }
}
