//! Remove the points that a depth image sees through.

use crate::{
    Error,
    memory::objects::{
        ObjectMap,
        depth_evidence::{Projection, check_image},
        visibility::Frustum,
    },
    sensors::{
        camera::Camera,
        unproject::{Point, has_depth},
    },
};

/// Conditions under which a point is seen through.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SeeThroughConfig {
    /// Smallest depth of a point.
    pub near_m: f64,
    /// Largest depth of a point.
    pub far_m: f64,
    /// A surface this much farther away than the point does not yet count as farther away.
    pub band_m: f64,
    /// The same as a share of the point's depth; the larger of the two counts.
    pub band_share: f64,
    /// All pixels within this many rows and columns must show something farther away, too.
    pub margin_px: usize,
}

impl Default for SeeThroughConfig {
    fn default() -> Self {
        Self { near_m: 0.01, far_m: 2.5, band_m: 0.1, band_share: 0.0, margin_px: 1 }
    }
}

impl SeeThroughConfig {
    fn check(&self) -> Result<(), Error> {
        Error::require("near_m", self.near_m, "at least 0", |v| v >= 0.0)?;
        Error::require("far_m", self.far_m, "at least 0", |v| v >= 0.0)?;
        Error::require("band_m", self.band_m, "0 to 10", |v| (0.0..=10.0).contains(&v))?;
        Error::require("band_share", self.band_share, "0 to 1", |v| (0.0..=1.0).contains(&v))?;
        Error::require("margin_px", self.margin_px, "0 to 8", |n| n <= 8)
    }
}

/// An entry that lost points.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Erosion {
    /// Its id.
    pub id: u64,
    /// Number of points that were removed.
    pub num_removed: usize,
    /// Number of points that are left; an entry without any is removed.
    pub num_left: usize,
}

impl ObjectMap {
    /// Remove the points of all entries that a depth image sees through, as DynaMem does (Liu et
    /// al., 2024: `clear_points`).
    ///
    /// A point at planar depth `z` within `near_m..=far_m` is seen through if the image shows
    /// something farther away than `z + max(band_m, band_share * z)` at its pixel and at all pixels
    /// within `margin_px` that have a depth.
    ///
    /// # Arguments
    /// * `depth_m` - planar depth, row-major, metres; infinite or not positive where there is none.
    ///
    /// # Returns
    /// The entries that lost points, by ascending id.
    ///
    /// # Errors
    /// As [`depth_evidence`](super::depth_evidence::depth_evidence); the map is then unchanged.
    ///
    /// # Complexity
    /// O(pixels + entries + points of the entries in view).
    pub fn remove_seen_through(
        &mut self,
        camera: &Camera,
        depth_m: &[f32],
        config: &SeeThroughConfig,
    ) -> Result<Vec<Erosion>, Error> {
        config.check()?;
        check_image(camera, depth_m)?;
        let frustum = Frustum::new(camera);
        let projection = Projection::new(camera);
        let is_gone = |point: Point| {
            projection.pixel_of(point).is_some_and(|(pixel, z)| {
                let limit_m = z + config.band_m.max(config.band_share * z);
                (config.near_m..=config.far_m).contains(&z)
                    && is_farther(depth_m, camera, pixel, limit_m, config.margin_px)
            })
        };
        let map_config = self.config;
        let mut eroded = Vec::new();
        for entry in self
            .entries
            .iter_mut()
            .filter(|entry| frustum.may_show(entry.cloud.bounds_m(), config.far_m))
        {
            let num_removed = entry.remove_points(is_gone, &map_config);
            if num_removed > 0 {
                let num_left = entry.cloud.points().len();
                eroded.push(Erosion { id: entry.id, num_removed, num_left });
            }
        }
        self.entries.retain(|entry| !entry.cloud.points().is_empty());
        Ok(eroded)
    }
}

/// Return whether a pixel, and every pixel around it that has a depth, is farther away than a limit.
fn is_farther(
    depth_m: &[f32],
    camera: &Camera,
    pixel: usize,
    limit_m: f64,
    margin_px: usize,
) -> bool {
    let (row, col) = (pixel / camera.width_px, pixel % camera.width_px);
    // The own pixel decides most often.
    has_depth(depth_m[pixel])
        && f64::from(depth_m[pixel]) > limit_m
        && (row.saturating_sub(margin_px)..(row + margin_px + 1).min(camera.height_px)).all(|row| {
            let first = row * camera.width_px;
            let cols = col.saturating_sub(margin_px)..(col + margin_px + 1).min(camera.width_px);
            depth_m[first + cols.start..first + cols.end]
                .iter()
                .all(|&depth| !has_depth(depth) || f64::from(depth) > limit_m)
        })
}
