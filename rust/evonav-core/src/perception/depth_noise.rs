//! Simulate the errors of a depth camera.

use crate::{Error, rng::Stream};

/// The errors of a depth camera. With zeros and an infinite `max_depth_m` there are none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DepthNoise {
    /// Standard deviation along the optical axis at distance 0, metres.
    pub sigma_m: f64,
    /// Growth of the standard deviation with the square of the distance, 1/metre; such a camera
    /// measures disparity.
    pub sigma_per_m: f64,
    /// Step between two distinguishable values, over the square of the distance, 1/metre.
    pub step_per_m: f64,
    /// Share of pixels without a value.
    pub dropout: f64,
    /// Share of pixels at edges without a value.
    pub edge_dropout: f64,
    /// Largest planar depth that has a value, metres.
    pub max_depth_m: f64,
}

/// Share of the nearer depth by which neighbouring depths must differ at an edge.
const EDGE_SHARE: f64 = 0.1;
/// Smallest value, whatever the noise.
const MIN_DEPTH_M: f64 = 0.01;

impl DepthNoise {
    /// Check the parameters.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] naming the first one outside its domain.
    pub fn check(&self) -> Result<(), Error> {
        let is_size = |v: f64| v.is_finite() && v >= 0.0;
        for (name, value) in [
            ("sigma_m", self.sigma_m),
            ("sigma_per_m", self.sigma_per_m),
            ("step_per_m", self.step_per_m),
        ] {
            Error::require(name, value, "finite and >= 0", is_size)?;
        }
        for (name, value) in [("dropout", self.dropout), ("edge_dropout", self.edge_dropout)] {
            Error::require(name, value, "in 0..=1", |v| (0.0..=1.0).contains(&v))?;
        }
        Error::require("max_depth_m", self.max_depth_m, "> 0", |v| v > 0.0)
    }
}

/// Add a camera's errors to a depth image.
///
/// Pixels are independent: each gets axial noise and is then rounded to the nearest step. The noise
/// is a sum of four uniform numbers (Irwin-Hall), which has no tail beyond 3.5 standard deviations.
///
/// # Arguments
/// * `depth_m` - row-major, `width_px` per row; infinite or not positive where there is none.
/// * `stream` - source of randomness; the noise of a pixel depends only on it and on the pixel's
///   index.
///
/// # Returns
/// The image, infinite where there is no value.
///
/// # Errors
/// [`Error::InvalidArgument`] if the image is not whole rows, holds NaN, or as [`DepthNoise::check`].
///
/// # Complexity
/// O(pixels).
///
/// # Source
/// Khoshelham & Oude Elberink, "Accuracy and Resolution of Kinect Depth Data for Indoor Mapping
/// Applications", Sensors 12(2), 2012: random error and step both grow with the square of depth.
pub fn noisy_depth(
    depth_m: &[f32],
    width_px: usize,
    noise: &DepthNoise,
    stream: &Stream,
) -> Result<Vec<f32>, Error> {
    noise.check()?;
    Error::require_rows("depth_m", depth_m.len(), width_px)?;
    if let Some(depth) = depth_m.iter().find(|depth| depth.is_nan()) {
        return Err(Error::invalid("depth_m", depth, "not NaN"));
    }
    let mut drawn = stream.clone();
    let mut found = Vec::with_capacity(depth_m.len());
    for (index, &depth) in depth_m.iter().enumerate() {
        let bits = drawn.next_u64();
        let share = (bits >> 48) as f64 / 65536.0;
        let true_m = f64::from(depth);
        if !(true_m > 0.0 && true_m <= noise.max_depth_m && true_m.is_finite()) {
            found.push(f32::INFINITY);
            continue;
        }
        let is_edge = noise.edge_dropout > 0.0 && is_at_edge(depth_m, width_px, index);
        if share < noise.dropout.max(if is_edge { noise.edge_dropout } else { 0.0 }) {
            found.push(f32::INFINITY);
            continue;
        }
        let square = true_m * true_m;
        let sigma_m = noise.sigma_m + noise.sigma_per_m * square;
        let step_m = noise.step_per_m * square;
        let mut value_m = true_m;
        if sigma_m > 0.0 {
            value_m += sigma_m * irwin_hall(bits);
        }
        if step_m > 0.0 {
            value_m = (value_m / step_m + 0.5) as i64 as f64 * step_m; // rounds what is positive
        }
        // Values without noise stay exactly the same.
        let is_same = sigma_m == 0.0 && step_m == 0.0;
        found.push(if is_same { depth } else { value_m.max(MIN_DEPTH_M) as f32 });
    }
    Ok(found)
}

/// Return the sum of four 12-bit uniform numbers, normalised to mean 0 and deviation 1.
fn irwin_hall(bits: u64) -> f64 {
    let sum: u64 = (0..4).map(|part| (bits >> (12 * part)) & 0xfff).sum();
    let uniform_sum = (sum as f64 + 2.0) / 4096.0; // each taken at the middle of its step
    (uniform_sum - 2.0) * 3.0_f64.sqrt()
}

fn is_at_edge(depth_m: &[f32], width_px: usize, index: usize) -> bool {
    let here = f64::from(depth_m[index]);
    let col = index % width_px;
    let beside = [
        (col > 0).then(|| index - 1),
        (col + 1 < width_px).then_some(index + 1),
        index.checked_sub(width_px),
        Some(index + width_px).filter(|&i| i < depth_m.len()),
    ];
    beside.into_iter().flatten().any(|other| {
        let there = f64::from(depth_m[other]);
        (there - here).abs() > EDGE_SHARE * here.min(there)
    })
}
