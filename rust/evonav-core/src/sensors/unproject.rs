//! Convert depth images to points.

use crate::{
    Error,
    sensors::{
        camera::Camera,
        runs::{Run, RunImage},
    },
};

/// A point in the world frame, in single precision: 8 micrometres at 100 m.
pub type Point = [f32; 3];

/// A depth image and the detections in it.
#[derive(Debug, Clone, Copy)]
pub struct MaskedDepth<'a> {
    /// Camera of the image.
    pub camera: Camera,
    /// Planar depth, row-major, metres; infinite or not positive where there is none.
    pub depth_m: &'a [f32],
    /// Detection of each pixel, negative if none.
    pub masks: &'a RunImage,
}

/// Return the points behind the pixels of each detection.
///
/// # Arguments
/// * `num_detections` - masks are numbered from 0 to one less than this.
/// * `max_points` - largest number of points of a mask. A mask with more pixels that have a depth
///   is thinned to every n-th of them in row-major order (3D-Mem: about 5,000).
///
/// # Returns
/// A list of points for each detection, in row-major order of the pixels.
///
/// # Errors
/// [`Error::InvalidArgument`] if an image's size is not the camera's, a depth is NaN, a mask's
/// number is too large, `max_points` 0, or the camera impossible.
///
/// # Complexity
/// O(pixels), two passes.
pub fn unproject_masks(
    image: MaskedDepth<'_>,
    num_detections: usize,
    max_points: usize,
) -> Result<Vec<Vec<Point>>, Error> {
    let MaskedDepth { camera, depth_m, masks } = image;
    camera.check()?;
    Error::require("max_points", max_points, "at least 1", |n| n > 0)?;
    for (name, len) in [("depth_m", depth_m.len()), ("masks", masks.shape().iter().product())] {
        Error::require(name, len, "one value a pixel of the camera", |n| {
            n == camera.width_px * camera.height_px
        })?;
    }
    Error::require("masks", masks.shape()[1], "as wide as the camera's image", |n| {
        n == camera.width_px
    })?;
    if let Some(depth) = first_nan(depth_m) {
        return Err(Error::invalid("depth_m", depth, "not NaN"));
    }
    let depth_of = |run: &Run| &depth_m[run.row * camera.width_px..][run.cols[0]..run.cols[1]];
    // Detection of each run, and the number of its pixels that have a depth.
    let mut found: Vec<(usize, Run, usize)> = Vec::new();
    let mut num_px = vec![0; num_detections];
    for run in masks.runs() {
        let Ok(detection) = usize::try_from(run.value) else { continue };
        let count = num_px.get_mut(detection).ok_or_else(|| {
            Error::invalid("masks", run.value, "negative or the index of a detection")
        })?;
        let num = depth_of(&run).iter().filter(|&&depth| has_depth(depth)).count();
        *count += num;
        found.push((detection, run, num));
    }
    let strides: Vec<usize> =
        num_px.iter().map(|n: &usize| n.div_ceil(max_points).max(1)).collect();
    let mut clouds: Vec<Vec<Point>> = num_px
        .iter()
        .zip(&strides)
        .map(|(num, stride)| Vec::with_capacity(num.div_ceil(*stride)))
        .collect();
    // Number of pixels of each detection before its next point.
    let mut skips = vec![0_usize; num_detections];
    // A pixel's ray is affine in its coordinates.
    let first = camera.ray([0.5, 0.5]);
    let [along_u, along_v] = [camera.ray([1.5, 0.5]), camera.ray([0.5, 1.5])]
        .map(|ray| [0, 1, 2].map(|i| ray[i] - first[i]));
    for (detection, run, num) in found {
        let start = [0, 1, 2].map(|i| first[i] + along_v[i] * run.row as f64);
        let depths = depth_of(&run);
        let point = |place: usize| {
            let (col, depth) = ((run.cols[0] + place) as f64, f64::from(depths[place]));
            [0, 1, 2].map(|i| {
                let ray = start[i] + along_u[i] * col;
                (camera.position_m[i] + ray * depth) as f32
            })
        };
        let (skip, stride) = (&mut skips[detection], strides[detection]);
        let cloud = &mut clouds[detection];
        if num == depths.len() {
            cloud.extend((*skip..num).step_by(stride).map(point));
        } else {
            let places = (0..depths.len()).filter(|&place| has_depth(depths[place]));
            cloud.extend(places.skip(*skip).step_by(stride).map(point));
        }
        *skip += num.saturating_sub(*skip).div_ceil(stride) * stride;
        *skip -= num;
    }
    Ok(clouds)
}

/// Return the first value that is NaN; whole chunks are compared at once.
fn first_nan(values: &[f32]) -> Option<f32> {
    let has_nan = |chunk: &[f32]| chunk.iter().fold(false, |found, value| found | value.is_nan());
    let chunk = values.chunks(64).find(|chunk| has_nan(chunk))?;
    chunk.iter().copied().find(|value| value.is_nan())
}

pub(crate) fn has_depth(depth_m: f32) -> bool {
    depth_m > 0.0 && depth_m < f32::INFINITY
}
