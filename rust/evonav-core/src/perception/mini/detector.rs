//! Detect instances in an image: run the network, join cells to instances, refine their outlines.

use crate::{
    Error,
    perception::mini::{
        instances::{Resemblance, refine, segments},
        network::{Network, input},
    },
};

/// Parameters of the detector.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DetectorConfig {
    /// Smallest number of cells of an instance (a cell has 4 x 4 pixels in an image of 300 x 300).
    pub min_cells: usize,
    /// Smallest mean probability of an instance's class.
    pub min_confidence: f32,
    /// Weights of the assignment of pixels to cells.
    pub resemblance: Resemblance,
}

/// The instances in an image.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Instances {
    /// Instance of each pixel, -1 if none. Instances are numbered in the order of their first cell.
    pub masks: Vec<i32>,
    /// Class of each instance, an index into [`Network::classes`].
    pub classes: Vec<usize>,
    /// Confidence of each instance, in 0..=1.
    pub confidences: Vec<f32>,
}

/// Find instances in an image.
///
/// # Arguments
/// * `rgb`, `depth_m`, `size_px`, `horizon_rad` - the image, as for [`input`].
///
/// # Errors
/// [`Error::InvalidArgument`] if the numbers of pixels do not agree, or the horizon or a threshold
/// is not a number.
pub fn detect(
    network: &Network,
    rgb: &[u8],
    depth_m: &[f32],
    size_px: [usize; 2],
    horizon_rad: f64,
    config: &DetectorConfig,
) -> Result<Instances, Error> {
    let logits = network.run(&input(rgb, depth_m, size_px, horizon_rad)?)?;
    let found = segments(&logits, config.min_cells, config.min_confidence)?;
    let masks = refine(&found.cells, rgb, depth_m, size_px, config.resemblance)?;
    Ok(Instances { masks, classes: found.classes, confidences: found.confidences })
}
