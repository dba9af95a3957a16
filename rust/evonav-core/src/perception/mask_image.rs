//! Images of masks: validation and neighbouring pixels.

use crate::{Error, sensors::runs::RunImage};

/// The size of a validated image of masks.
pub(super) struct MaskImage {
    width_px: usize,
    height_px: usize,
}

impl MaskImage {
    pub fn new(masks: &[i32], width_px: usize, num_masks: usize) -> Result<Self, Error> {
        Error::require_rows("masks", masks.len(), width_px)?;
        for run in RunImage::of(masks, width_px)?.runs() {
            Error::require("masks", run.value, "negative or the index of a detection", |mask| {
                usize::try_from(mask).is_ok_and(|mask| mask < num_masks) || mask < 0
            })?;
        }
        Ok(Self { width_px, height_px: masks.len() / width_px })
    }

    /// Return the four pixels beside one; `None` past the image's border.
    pub fn beside(&self, index: usize) -> [Option<usize>; 4] {
        let (row, col) = (index / self.width_px, index % self.width_px);
        [
            (col > 0).then(|| index - 1),
            (col + 1 < self.width_px).then_some(index + 1),
            (row > 0).then(|| index - self.width_px),
            (row + 1 < self.height_px).then_some(index + self.width_px),
        ]
    }

    /// Call `call` with each pixel within a radius and its squared distance.
    pub fn around(&self, index: usize, radius_px: f64, mut call: impl FnMut(usize, u32)) {
        let (row, col) = (index / self.width_px, index % self.width_px);
        let reach = radius_px as usize;
        for r in row.saturating_sub(reach)..(row + reach + 1).min(self.height_px) {
            for c in col.saturating_sub(reach)..(col + reach + 1).min(self.width_px) {
                let square = row.abs_diff(r).pow(2) + col.abs_diff(c).pow(2);
                if square as f64 <= radius_px * radius_px {
                    call(r * self.width_px + c, square as u32);
                }
            }
        }
    }
}
