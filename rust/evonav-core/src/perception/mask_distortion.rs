//! Masks as a detector that errs gives them: cut, split, too small or too large.

use crate::{Error, perception::mask_image::MaskImage};

/// Largest margin that a mask may gain or lose.
pub const MAX_MARGIN_PX: f64 = 32.0;

/// What becomes of a mask.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MaskChange {
    /// Its number afterwards; negative if it is not detected.
    pub becomes: i32,
    /// Number of the part at or past `split_px`; the same as `becomes` if it stays in one piece.
    pub rest_becomes: i32,
    /// Whether it is split between columns rather than between rows.
    pub is_split_by_col: bool,
    /// First column, or row, of the rest.
    pub split_px: i32,
    /// Pixels that it gains beyond its outline, over whatever is there, or loses within it if negative.
    pub margin_px: f64,
    /// Rows and columns `[top, left, bottom, right]` that it is cut to, the last two one past the end.
    pub crop_px: [i32; 4],
}

impl MaskChange {
    /// Return no change, but for the number.
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

/// Return the masks as a detector that errs would give them.
///
/// A pixel is lost to a mask that shrinks if a pixel outside of the mask (the image's border is
/// none) is within its margin, centre to centre. A pixel is gained by the mask that grows and has
/// the nearest pixel within its margin, the lower number among equals. Then masks are cut and renamed.
///
/// # Arguments
/// * `masks` - row-major, `width_px` a row; negative where nothing is.
/// * `changes` - by mask.
///
/// # Returns
/// The image afterwards, -1 where nothing is.
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
    // Squared distance to the pixel that a gained pixel was gained from.
    let mut from = vec![u32::MAX; masks.len()];
    let has_margins = changes.iter().any(|change| change.margin_px != 0.0);
    for index in outline_px(masks, width_px).filter(|_| has_margins) {
        let mask = masks[index];
        // Of a pixel outside: what the masks beside it lose to it. Losing twice is losing once.
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
        // Of a pixel on an outline: what its mask gains.
        let Some(change) = change_of(mask).filter(|c| c.becomes >= 0 && c.margin_px > 0.0) else {
            continue;
        };
        image.around(index, change.margin_px, |near, square| {
            let held = if from[near] == u32::MAX { i32::MAX } else { found[near] };
            if masks[near] != mask && (square, mask) < (from[near], held) {
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
                let is_kept = is_in && (left..right).contains(&col);
                let is_first = !is_rest && col < split_col;
                let number = if is_first { change.becomes } else { change.rest_becomes };
                *pixel = if is_kept { number.max(-1) } else { -1 };
            }
        }
    }
    Ok(found)
}

/// Return the pixels with a pixel of something else beside them, above or below.
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
