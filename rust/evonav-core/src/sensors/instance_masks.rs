//! Instance images of the simulator as anonymous detections.

use crate::Error;

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
    pub labels: Vec<i32>,
    /// Instance (index into the caller's table) of each detection.
    pub instances: Vec<usize>,
}

/// Renumber an instance image. Detections are numbered in the order of their first pixel, so their
/// numbers do not reveal the instances.
///
/// # Arguments
/// * `image` - row-major, `width_px` a row; 0 where nothing is, else 1 + index into `is_detectable`.
/// * `is_detectable` - whether each instance may be detected (walls may not).
///
/// # Errors
/// [`Error::InvalidArgument`] if the image is not whole rows, holds a number outside the table, or the filter is not a number.
///
/// # Complexity
/// O(pixels + instances), two passes.
pub fn number_instances(
    image: &[i32],
    width_px: usize,
    is_detectable: &[bool],
    filter: MaskFilter,
) -> Result<Masks, Error> {
    Error::require("max_box_fraction", filter.max_box_fraction, "in 0..=1", |v| {
        (0.0..=1.0).contains(&v)
    })?;
    Error::require_rows("instances", image.len(), width_px)?;
    let mut extents = vec![Extent::EMPTY; is_detectable.len()];
    let mut order = Vec::new();
    // Value and length of every run.
    let mut seen = Vec::new();
    for (row, pixels) in image.chunks_exact(width_px).enumerate() {
        for (value, cols) in runs(pixels) {
            seen.push((value, cols[1] - cols[0]));
            let Some(instance) = usize::try_from(value).ok().and_then(|v| v.checked_sub(1)) else {
                Error::require("instances", value, "0 or 1 + an index of an object", |v| v == 0)?;
                continue;
            };
            let extent = extents.get_mut(instance).ok_or_else(|| {
                Error::invalid("instances", value, "0 or 1 + an index of an object")
            })?;
            if extent.area_px == 0 {
                order.push(instance);
            }
            extent.add(row, cols);
        }
    }
    let max_box_px = filter.max_box_fraction * image.len() as f64;
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
    let mut labels = Vec::with_capacity(image.len());
    for (value, len) in seen {
        labels.resize(labels.len() + len, number_of[value as usize]);
    }
    Ok(Masks { labels, instances: order })
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
/// O(pixels), one pass; a run of equal pixels is added in one step.
pub fn instance_areas(image: &[i32], num_instances: usize) -> Result<Vec<i64>, Error> {
    let mut areas = vec![0; num_instances + 1];
    for run in image.chunk_by(|a, b| a == b) {
        let area = usize::try_from(run[0])
            .ok()
            .and_then(|value| areas.get_mut(value))
            .ok_or_else(|| Error::invalid("instances", run[0], "0 or 1 + an index of an object"))?;
        *area += run.len() as i64;
    }
    areas.remove(0);
    Ok(areas)
}

/// Return the area and bounding box of each mask.
///
/// # Arguments
/// * `masks` - row-major, `width_px` a row; negative where nothing is.
/// * `num_masks` - masks are numbered from 0 to one less than this.
///
/// # Errors
/// [`Error::InvalidArgument`] if the image is not whole rows, or holds a larger number.
///
/// # Complexity
/// O(pixels + masks).
pub fn mask_extents(
    masks: &[i32],
    width_px: usize,
    num_masks: usize,
) -> Result<Vec<Extent>, Error> {
    Error::require_rows("masks", masks.len(), width_px)?;
    let mut extents = vec![Extent::EMPTY; num_masks];
    for (row, pixels) in masks.chunks_exact(width_px).enumerate() {
        for (mask, cols) in runs(pixels) {
            let Ok(mask) = usize::try_from(mask) else { continue };
            let extent = extents.get_mut(mask).ok_or_else(|| {
                Error::invalid("masks", mask, "negative or the index of a detection")
            })?;
            extent.add(row, cols);
        }
    }
    Ok(extents)
}

/// Return the runs of equal pixels: value, index of the first pixel, and index after the last.
pub(crate) fn runs(pixels: &[i32]) -> impl Iterator<Item = (i32, [usize; 2])> {
    let mut next = 0;
    std::iter::from_fn(move || {
        let (start, &value) = (next, pixels.get(next)?);
        next += 1;
        // Eight pixels are compared at once.
        let differ =
            |chunk: &[i32]| chunk.iter().fold(false, |found, &pixel| found | (pixel != value));
        while pixels.get(next..next + 8).is_some_and(|chunk| !differ(chunk)) {
            next += 8;
        }
        while pixels.get(next) == Some(&value) {
            next += 1;
        }
        Some((value, [start, next]))
    })
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
    fn add(&mut self, row: usize, cols: [usize; 2]) {
        *self = if self.area_px == 0 {
            Self { area_px: cols[1] - cols[0], rows: [row, row + 1], cols }
        } else {
            Self {
                area_px: self.area_px + cols[1] - cols[0],
                rows: [self.rows[0], row + 1],
                cols: [self.cols[0].min(cols[0]), self.cols[1].max(cols[1])],
            }
        };
    }

    fn box_px(&self) -> usize {
        (self.rows[1] - self.rows[0]) * (self.cols[1] - self.cols[0])
    }
}
