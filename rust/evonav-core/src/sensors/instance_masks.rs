//! Instance images of the simulator as anonymous detections.

use crate::{
    Error,
    sensors::runs::{Run, RunImage},
};

/// The smallest and largest masks that count as detections.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MaskFilter {
    /// Smallest number of pixels of a mask.
    pub min_area_px: usize,
    /// Largest share of the image that a mask's bounding box may cover.
    pub max_box_fraction: f64,
}

/// A renumbered instance image.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Masks {
    /// Detection of each pixel, -1 where none.
    pub labels: RunImage,
    /// Instance (index into the caller's table) of each detection.
    pub instances: Vec<usize>,
}

/// Renumber an instance image. Detections are numbered in the order of their first pixel, so their
/// numbers do not reveal the instances.
///
/// # Arguments
/// * `image` - 0 where nothing is, else 1 + index into `is_detectable`.
/// * `is_detectable` - whether each instance may be detected (walls may not).
///
/// # Errors
/// [`Error::InvalidArgument`] if the image holds a number outside the table, or the filter is not a number.
///
/// # Complexity
/// O(runs + instances), two passes.
pub fn number_instances(
    image: &RunImage,
    is_detectable: &[bool],
    filter: MaskFilter,
) -> Result<Masks, Error> {
    Error::require("max_box_fraction", filter.max_box_fraction, "in 0..=1", |v| {
        (0.0..=1.0).contains(&v)
    })?;
    let mut extents = vec![Extent::EMPTY; is_detectable.len()];
    let mut order = Vec::new();
    for run in image.runs() {
        let instance = usize::try_from(run.value).ok().and_then(|value| value.checked_sub(1));
        let Some(instance) = instance else {
            Error::require("instances", run.value, "0 or 1 + an index of an object", |v| v == 0)?;
            continue;
        };
        let extent = extents.get_mut(instance).ok_or_else(|| {
            Error::invalid("instances", run.value, "0 or 1 + an index of an object")
        })?;
        if extent.area_px == 0 {
            order.push(instance);
        }
        extent.add(&run);
    }
    let [height_px, width_px] = image.shape();
    let max_box_px = filter.max_box_fraction * (height_px * width_px) as f64;
    order.retain(|&instance| {
        let extent = &extents[instance];
        is_detectable[instance]
            && extent.area_px >= filter.min_area_px
            && extent.box_px() as f64 <= max_box_px
    });
    let mut number_of = vec![-1; is_detectable.len() + 1];
    for (number, &instance) in order.iter().enumerate() {
        number_of[instance + 1] = number as i32;
    }
    let labels = image.renumbered(|value| Ok(number_of[value as usize]))?;
    Ok(Masks { labels, instances: order })
}

/// Give the detections of an image other numbers.
///
/// # Arguments
/// * `masks` - negative where nothing is.
/// * `numbers` - new number of each detection, negative for none.
///
/// # Errors
/// [`Error::InvalidArgument`] if the image holds a number outside the table.
///
/// # Complexity
/// O(runs).
pub fn renumber_masks(masks: &RunImage, numbers: &[i32]) -> Result<RunImage, Error> {
    masks.renumbered(|mask| match usize::try_from(mask) {
        Err(_) => Ok(-1),
        Ok(index) => numbers.get(index).copied().ok_or_else(|| outside(mask)),
    })
}

fn outside(mask: i32) -> Error {
    Error::invalid("masks", mask, "negative or the index of a detection")
}

/// Count the pixels of each instance, by which an evaluator decides what is in view.
///
/// # Arguments
/// * `image` - 0 where nothing is, else 1 + index of the instance.
/// * `num_instances` - number of instances in the caller's table.
///
/// # Returns
/// Number of pixels by instance.
///
/// # Errors
/// [`Error::InvalidArgument`] if the image holds a number outside the table.
///
/// # Complexity
/// O(runs + instances).
pub fn instance_areas(image: &RunImage, num_instances: usize) -> Result<Vec<i64>, Error> {
    let mut areas = vec![0; num_instances + 1];
    for run in image.runs() {
        let area =
            usize::try_from(run.value).ok().and_then(|value| areas.get_mut(value)).ok_or_else(
                || Error::invalid("instances", run.value, "0 or 1 + an index of an object"),
            )?;
        *area += run.num_pixels() as i64;
    }
    areas.remove(0);
    Ok(areas)
}

/// Return the area and bounding box of each mask.
///
/// # Arguments
/// * `masks` - negative where nothing is.
/// * `num_masks` - masks are numbered from 0 to one less than this.
///
/// # Errors
/// [`Error::InvalidArgument`] if the image holds a larger number.
///
/// # Complexity
/// O(runs + masks).
pub fn mask_extents(masks: &RunImage, num_masks: usize) -> Result<Vec<Extent>, Error> {
    let mut extents = vec![Extent::EMPTY; num_masks];
    for run in masks.runs() {
        let Ok(mask) = usize::try_from(run.value) else { continue };
        extents.get_mut(mask).ok_or_else(|| outside(run.value))?.add(&run);
    }
    Ok(extents)
}

/// Area and bounding box of some pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Extent {
    /// Number of pixels.
    pub area_px: usize,
    /// First row, and one past the last; both 0 without pixels.
    pub rows: [usize; 2],
    /// First column, and one past the last; both 0 without pixels.
    pub cols: [usize; 2],
}

impl Extent {
    const EMPTY: Self = Self { area_px: 0, rows: [0; 2], cols: [0; 2] };

    /// Add part of a row; rows must come in ascending order.
    fn add(&mut self, run: &Run) {
        let Run { row, cols, .. } = *run;
        *self = if self.area_px == 0 {
            Self { area_px: run.num_pixels(), rows: [row, row + 1], cols }
        } else {
            Self {
                area_px: self.area_px + run.num_pixels(),
                rows: [self.rows[0], row + 1],
                cols: [self.cols[0].min(cols[0]), self.cols[1].max(cols[1])],
            }
        };
    }

    fn box_px(&self) -> usize {
        (self.rows[1] - self.rows[0]) * (self.cols[1] - self.cols[0])
    }
}
