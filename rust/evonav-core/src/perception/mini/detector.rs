//! From a picture to instances: the network, its instances, their outlines.

use crate::{
    Error,
    perception::mini::{
        instances::{Resemblance, refine, segments},
        network::{Network, input},
    },
};

/// What is taken for an instance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DetectorConfig {
    /// Fewest cells (each of 4 x 4 pixels in a picture of 300 x 300).
    pub min_cells: usize,
    /// Least mean probability of its class.
    pub min_confidence: f32,
    /// How pixels are given to cells.
    pub resemblance: Resemblance,
}

/// Instances in a picture.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Instances {
    /// Instance of each pixel, -1 where none; numbered in the order of their first cell.
    pub masks: Vec<i32>,
    /// Class of each instance, an index into [`Network::classes`].
    pub classes: Vec<usize>,
    /// In 0..=1.
    pub confidences: Vec<f32>,
}

/// Find instances in a picture.
///
/// # Arguments
/// * `rgb`, `depth_m`, `size_px`, `horizon_rad` - as for [`input`].
///
/// # Errors
/// [`Error::InvalidArgument`] if the numbers of pixels are off, or the horizon or a threshold is not a number.
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
