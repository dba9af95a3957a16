//! Distort masks as an imperfect detector does: cut, split, too small or too large.

use crate::{Error, perception::mask_image::MaskImage};

/// Largest margin by which a mask may grow or shrink.
pub const MAX_MARGIN_PX: f64 = 32.0;

/// The changes of one mask.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MaskChange {
    /// Number of the mask afterwards; negative if it is not detected.
    pub becomes: i32,
    /// Number of the part at or past `split_px`; the same as `becomes` if it stays in one piece.
    pub rest_becomes: i32,
    /// Whether it is split between columns rather than between rows.
    pub is_split_by_col: bool,
    /// First column, or row, of the rest.
    pub split_px: i32,
    /// Margin by which it grows over its surroundings, or shrinks if negative.
    pub margin_px: f64,
    /// Rows and columns `[top, left, bottom, right]` to which it is cut; the last two are one past
    /// the end.
    pub crop_px: [i32; 4],
}

impl MaskChange {
    /// Create a change of nothing but the number.
    pub fn renamed(number: i32) -> Self {
        Self {
            becomes: number,
            rest_becomes: number,
            is_split_by_col: false,
            split_px: i32::MAX,
            margin_px: 0.0,
            crop_px: [0, 0, i32::MAX, i32::MAX],
        }
    }
}

/// Apply changes to masks.
///
/// A shrinking mask loses a pixel if a pixel outside of the mask is within its margin, centre to
/// centre; the image's border does not count as outside. A pixel is gained by the growing mask that
/// has the nearest pixel within its margin, of equals the one with the lower number. Then masks are
/// cut and renumbered.
///
/// # Arguments
/// * `masks` - row-major, `width_px` per row; negative where nothing is.
/// * `changes` - the change of each mask.
///
/// # Returns
/// The changed image, -1 where nothing is.
///
/// # Errors
/// [`Error::InvalidArgument`] if the image is not whole rows or holds a number without a change,
/// or a margin is beyond [`MAX_MARGIN_PX`].
///
/// # Complexity
/// O(pixels + outline x margin^2).
pub fn distort_masks(
    masks: &[i32],
    width_px: usize,
    changes: &[MaskChange],
) -> Result<Vec<i32>, Error> {
    let image = MaskImage::new(masks, width_px, changes.len())?;
    for change in changes {
        Error::require("margin_px", change.margin_px, "at most 32 either way", |v| {
            v.abs() <= MAX_MARGIN_PX
        })?;
    }
    let change_of = |mask: i32| usize::try_from(mask).ok().and_then(|mask| changes.get(mask));
    let mut found = masks.to_vec();
    // Squared distance to the pixel from which each gained pixel was gained.
    let mut from = vec![u32::MAX; masks.len()];
    let has_margins = changes.iter().any(|change| change.margin_px != 0.0);
    for index in outline_px(masks, width_px).filter(|_| has_margins) {
        let mask = masks[index];
        // Masks beside a pixel outside of them lose pixels to it. A pixel that is lost twice is
        // lost once.
        for other in image.beside(index).into_iter().flatten() {
            let loser = masks[other];
            let Some(change) = change_of(loser).filter(|c| loser != mask && c.margin_px < 0.0)
            else {
                continue;
            };
            image.around(index, -change.margin_px, |near, _| {
                if masks[near] == loser && from[near] == u32::MAX {
                    found[near] = -1;
                }
            });
        }
        // A growing mask gains pixels around each pixel of its outline.
        let Some(change) = change_of(mask).filter(|c| c.becomes >= 0 && c.margin_px > 0.0) else {
            continue;
        };
        image.around(index, change.margin_px, |near, square| {
            let gained_by = if from[near] == u32::MAX { i32::MAX } else { found[near] };
            if masks[near] != mask && (square, mask) < (from[near], gained_by) {
                (from[near], found[near]) = (square, mask);
            }
        });
    }
    for (row, pixels) in found.chunks_exact_mut(width_px).enumerate() {
        let row = row as i32;
        let mut start = 0;
        for run in pixels.chunk_by_mut(|a, b| a == b) {
            let (first, end) = (start, start + run.len() as i32);
            start = end;
            let Some(change) = change_of(run[0]) else {
                run.fill(-1);
                continue;
            };
            let [top, left, bottom, right] = change.crop_px;
            let is_rest = !change.is_split_by_col && row >= change.split_px;
            let split_col = if change.is_split_by_col { change.split_px } else { i32::MAX };
            let is_in = (top..bottom).contains(&row);
            for (col, pixel) in (first..end).zip(run) {
                let is_inside = is_in && (left..right).contains(&col);
                let is_first = !is_rest && col < split_col;
                let number = if is_first { change.becomes } else { change.rest_becomes };
                *pixel = if is_inside { number.max(-1) } else { -1 };
            }
        }
    }
    Ok(found)
}

/// Return the pixels that have a different pixel beside, above or below them.
fn outline_px(masks: &[i32], width_px: usize) -> impl Iterator<Item = usize> {
    (0..masks.len()).step_by(width_px).flat_map(move |start| {
        let row = &masks[start..start + width_px];
        let above = masks.get(start.wrapping_sub(width_px)..start).unwrap_or(row);
        let below = masks.get(start + width_px..start + 2 * width_px).unwrap_or(row);
        (0..width_px).filter_map(move |col| {
            let here = row[col];
            let is_same = above[col] == here
                && below[col] == here
                && row[col.saturating_sub(1)] == here
                && row[(col + 1).min(width_px - 1)] == here;
            (!is_same).then_some(start + col)
        })
    })
}
