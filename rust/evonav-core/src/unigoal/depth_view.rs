//! One view of a depth camera.

use crate::{Error, sensors::camera::Camera};

/// A depth image, with an optional category for each pixel.
#[derive(Debug, Clone, Copy)]
pub struct DepthView<'a> {
    /// Camera of the image; heights are relative to the floor.
    pub camera: Camera,
    /// Planar depth, row-major.
    pub depth_m: &'a [f32],
    /// Category index of each pixel, -1 if none.
    pub categories: Option<&'a [i32]>,
}

impl DepthView<'_> {
    pub(super) fn check(&self, num_categories: usize) -> Result<(), Error> {
        self.camera.check()?;
        let num = self.camera.width_px * self.camera.height_px;
        Error::require("depth_m", self.depth_m.len(), "one value a pixel", |n| n == num)?;
        let Some(categories) = self.categories else { return Ok(()) };
        Error::require("categories", categories.len(), "one value a pixel", |n| n == num)?;
        let is_known = |c: &i32| *c >= -1 && i64::from(*c) < num_categories as i64;
        let Some(category) = categories.iter().find(|c| !is_known(c)) else { return Ok(()) };
        let expected = format!("-1 to {}", num_categories as i64 - 1);
        Err(Error::invalid("categories", category, &expected))
    }
}
