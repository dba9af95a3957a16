//! Compare remembered points with a depth image, to tell what is still there, gone or hidden.

use crate::{
    Error,
    geometry::{rotate, sub},
    sensors::{
        camera::Camera,
        unproject::{Point, has_depth},
    },
};

/// Parameters of depth evidence.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EvidenceConfig {
    /// Largest number of points of an entry that are compared; of a larger entry, this many are
    /// taken evenly from its points in order of arrival.
    pub max_points: usize,
    /// Smallest difference between a point's depth and the image's that counts as a difference.
    pub band_m: f64,
    /// The same as a share of the point's depth; the larger of the two counts.
    pub band_share: f64,
}

impl Default for EvidenceConfig {
    fn default() -> Self {
        Self { max_points: 256, band_m: 0.1, band_share: 0.02 }
    }
}

impl EvidenceConfig {
    fn check(&self) -> Result<(), Error> {
        Error::require("max_points", self.max_points, "at least 1", |n| n > 0)?;
        Error::require("band_m", self.band_m, "0 to 10", |v| (0.0..=10.0).contains(&v))?;
        Error::require("band_share", self.band_share, "0 to 1", |v| (0.0..=1.0).contains(&v))
    }
}

/// Number of an entry's compared points by what the depth image shows at their pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct DepthEvidence {
    /// The image shows something farther away: nothing is at the point.
    pub num_see_through: u32,
    /// The image shows a surface at the point.
    pub num_supported: u32,
    /// The image shows something nearer, which hides the point.
    pub num_occluded: u32,
    /// The point is behind the camera or outside the image, or its pixel has no depth.
    pub num_out_of_view: u32,
}

/// Compare the points of entries with a depth image.
///
/// A point at planar depth `z` is compared with the depth `d` of the pixel that it falls on. With
/// `band = max(band_m, band_share * z)`, it is seen through if `d > z + band`, occluded if
/// `d < z - band`, and supported otherwise. A pixel without a depth says nothing.
///
/// # Arguments
/// * `clouds` - points of each entry, world frame.
/// * `camera` - camera of the image.
/// * `depth_m` - planar depth, row-major, metres; infinite or not positive where there is none.
///
/// # Returns
/// The counts of each entry, in order. Their sum is the number of compared points.
///
/// # Errors
/// [`Error::InvalidArgument`] if the image's size is not the camera's, a depth is NaN, the camera
/// is impossible, or a parameter is outside its domain.
///
/// # Complexity
/// O(pixels + entries x `max_points`); no allocation but the result.
///
/// # Examples
/// ```
/// # use evonav_core::{memory::objects::depth_evidence::*, sensors::camera::Camera};
/// let camera = Camera {
///     width_px: 2,
///     height_px: 2,
///     vertical_fov_rad: 1.5,
///     position_m: [0.0, 1.5, 0.0],
///     yaw_rad: 0.0,
///     horizon_rad: 0.0,
/// };
/// let cup = [[0.1, 1.4, 2.0], [0.1, 1.6, 2.0]];
/// let found = depth_evidence([&cup[..]], &camera, &[4.0; 4], &EvidenceConfig::default())?;
/// assert_eq!(found[0].num_see_through, 2);
/// # Ok::<(), evonav_core::Error>(())
/// ```
pub fn depth_evidence<'a>(
    clouds: impl IntoIterator<Item = &'a [Point]>,
    camera: &Camera,
    depth_m: &[f32],
    config: &EvidenceConfig,
) -> Result<Vec<DepthEvidence>, Error> {
    config.check()?;
    check_image(camera, depth_m)?;
    let projection = Projection::new(camera);
    let compare = |points: &[Point]| {
        let mut found = DepthEvidence::default();
        let num = points.len().min(config.max_points);
        for k in 0..num {
            let measured = projection.pixel_of(points[k * points.len() / num]);
            let Some((pixel, z)) = measured.filter(|&(pixel, _)| has_depth(depth_m[pixel])) else {
                found.num_out_of_view += 1;
                continue;
            };
            let depth = f64::from(depth_m[pixel]);
            let band_m = config.band_m.max(config.band_share * z);
            if depth > z + band_m {
                found.num_see_through += 1;
            } else if depth < z - band_m {
                found.num_occluded += 1;
            } else {
                found.num_supported += 1;
            }
        }
        found
    };
    Ok(clouds.into_iter().map(compare).collect())
}

/// Check a depth image.
pub(super) fn check_image(camera: &Camera, depth_m: &[f32]) -> Result<(), Error> {
    camera.check()?;
    let num_px = camera.width_px * camera.height_px;
    Error::require("depth_m", depth_m.len(), "one value a pixel of the camera", |n| n == num_px)?;
    match depth_m.iter().find(|depth| depth.is_nan()) {
        Some(depth) => Err(Error::invalid("depth_m", depth, "not NaN")),
        None => Ok(()),
    }
}

/// [`Camera::project`] with the parts that are the same for all points computed once.
pub(super) struct Projection<'a> {
    camera: &'a Camera,
    axes: [[f64; 3]; 3],
    centre_px: [f64; 2],
    focal_px: f64,
}

impl<'a> Projection<'a> {
    pub(super) fn new(camera: &'a Camera) -> Self {
        Self {
            camera,
            axes: camera.camera_from_world(),
            centre_px: camera.centre_px(),
            focal_px: camera.focal_px(),
        }
    }

    /// Return the index of the pixel that a point falls on, and its planar depth; `None` outside of
    /// the image.
    pub(super) fn pixel_of(&self, point: Point) -> Option<(usize, f64)> {
        let offset_m = sub(point.map(f64::from), self.camera.position_m);
        let [x, y, z] = rotate(&self.axes, offset_m);
        if z <= 0.0 {
            return None;
        }
        let scale = self.focal_px / z;
        let [u, v] = [self.centre_px[0] + scale * x, self.centre_px[1] + scale * y];
        let Camera { width_px, height_px, .. } = *self.camera;
        let is_inside = u >= 0.0 && u < width_px as f64 && v >= 0.0 && v < height_px as f64;
        is_inside.then_some((v as usize * width_px + u as usize, z))
    }
}
