//! What masks of a detector are like: cut, too small, too large, in pieces, where nothing is.

use crate::{
    Error,
    rng::Stream,
    sensors::{camera::Camera, instance_masks::runs},
};

/// Largest margin that a mask may gain or lose.
pub const MAX_MARGIN_PX: f64 = 32.0;

/// A mask's outline against the depth around it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Outline {
    /// Sides of its pixels with no pixel of the mask on the other side.
    pub num_sides: usize,
    /// Those of them where it is not its own: something nearer begins there, or the image ends.
    pub num_cut: usize,
    /// Mean planar depth of its pixels that have one, metres; infinite if none has.
    pub mean_depth_m: f64,
}

/// Outline of each mask, and how much of it is cut by something nearer or by the image's border:
/// a cheap sign of occlusion that needs no second rendering and no box.
///
/// Something is nearer if its depth is less by more than 5 cm and 5% of the mask's own; what an
/// object stands on, and meets at its foot, is not.
///
/// # Arguments
/// * `masks` - row-major, `width_px` a row; negative where nothing is.
/// * `depth_m` - of the same pixels.
/// * `num_masks` - masks count from 0 to one less.
///
/// # Errors
/// [`Error::InvalidArgument`] if the images differ in size, are not whole rows, or hold a larger number.
///
/// # Complexity
/// O(pixels).
pub fn mask_outlines(
    masks: &[i32],
    depth_m: &[f32],
    width_px: usize,
    num_masks: usize,
) -> Result<Vec<Outline>, Error> {
    let image = Image::new(masks, width_px, num_masks)?;
    Error::require("depth_m", depth_m.len(), "one value a pixel of the masks", |n| {
        n == masks.len()
    })?;
    let mut found = vec![Outline::default(); num_masks];
    let mut with_depth = vec![0_usize; num_masks];
    for (index, &mask) in masks.iter().enumerate() {
        let Ok(number) = usize::try_from(mask) else { continue };
        let (outline, depth) = (&mut found[number], f64::from(depth_m[index]));
        if depth > 0.0 && depth.is_finite() {
            outline.mean_depth_m += depth;
            with_depth[number] += 1;
        }
        for side in image.beside(index) {
            let Some(other) = side else {
                outline.num_sides += 1;
                outline.num_cut += 1;
                continue;
            };
            if masks[other] != mask {
                outline.num_sides += 1;
                let there = f64::from(depth_m[other]);
                outline.num_cut += usize::from(there < depth - 0.05 - 0.05 * depth);
            }
        }
    }
    for (outline, num) in found.iter_mut().zip(with_depth) {
        outline.mean_depth_m =
            if num > 0 { outline.mean_depth_m / num as f64 } else { f64::INFINITY };
    }
    Ok(found)
}

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
    /// No change, but for the number.
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

/// Masks as a detector that errs would give them.
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
    let image = Image::new(masks, width_px, changes.len())?;
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

/// A place on a surface in view where something may be seen that is not there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Site {
    /// Row and column of the pixel nearest to the middle of the place.
    pub pixel: [usize; 2],
    /// Its planar depth, metres.
    pub depth_m: f64,
    /// Standard normal: the lower, the sooner something is seen here.
    pub latent: f64,
    /// Uniform in 0..1, the same in every view of the place: what is seen, and how large.
    pub what: [f64; 2],
    /// Standard normal, of this view alone.
    pub how: f64,
}

/// How places err: what lasts, and what is a view's.
#[derive(Debug, Clone)]
pub struct SiteNoise {
    /// Edge of the places, which are cells of a grid in the world, metres.
    pub cell_m: f64,
    /// Rows and columns between the pixels that are looked at.
    pub stride_px: usize,
    /// Correlation of a place's latents in two views, 0 to 1.
    pub persistence: f64,
    /// What lasts is drawn from here, by place.
    pub lasting: Stream,
    /// What does not is drawn from here, by place.
    pub passing: Stream,
}

/// Places on the surfaces in view, with what is random of each: it depends on streams and place
/// alone, so that what is seen by mistake is seen there again.
///
/// # Arguments
/// * `depth_m` - of the camera's image.
///
/// # Returns
/// Sites by cell.
///
/// # Errors
/// [`Error::InvalidArgument`] if the image's size is not the camera's, or a parameter is outside its domain.
///
/// # Complexity
/// O(n log n) in the pixels that are looked at.
pub fn surface_sites(
    depth_m: &[f32],
    camera: &Camera,
    noise: &SiteNoise,
) -> Result<Vec<Site>, Error> {
    camera.check()?;
    Error::require("depth_m", depth_m.len(), "one value a pixel of the camera", |n| {
        n == camera.width_px * camera.height_px
    })?;
    Error::require("cell_m", noise.cell_m, "0.01 or more", |v| v >= 0.01 && v.is_finite())?;
    Error::require("stride_px", noise.stride_px, "1 or more", |n| n > 0)?;
    Error::require("persistence", noise.persistence, "in 0..=1", |v| (0.0..=1.0).contains(&v))?;
    let mut seen = Vec::new();
    for row in (noise.stride_px / 2..camera.height_px).step_by(noise.stride_px) {
        for col in (noise.stride_px / 2..camera.width_px).step_by(noise.stride_px) {
            let depth = f64::from(depth_m[row * camera.width_px + col]);
            // Beyond what houses are, cells would not fit their numbers.
            if !(depth > 0.0 && depth < 1e4) {
                continue;
            }
            let point_m = camera.unproject([col as f64 + 0.5, row as f64 + 0.5], depth);
            let cell = point_m.map(|v| (v / noise.cell_m).floor());
            let off_m: f64 =
                (0..3).map(|i| (point_m[i] - (cell[i] + 0.5) * noise.cell_m).powi(2)).sum();
            seen.push((cell.map(|v| v as i64), off_m, [row, col], depth));
        }
    }
    seen.sort_by_key(|one| (one.0, one.2));
    let (own, shared) = ((1.0 - noise.persistence).sqrt(), noise.persistence.sqrt());
    let nearest = |cell: &[([i64; 3], f64, [usize; 2], f64)]| {
        let best = cell.iter().min_by(|a, b| a.1.total_cmp(&b.1)).copied()?;
        let (place, _, pixel, depth_m) = best;
        let (mut lasting, mut passing) = (noise.lasting.at(&place), noise.passing.at(&place));
        Some(Site {
            pixel,
            depth_m,
            latent: shared * lasting.normal() + own * passing.normal(),
            what: [lasting.uniform(), lasting.uniform()],
            how: passing.normal(),
        })
    };
    Ok(seen.chunk_by(|a, b| a.0 == b.0).filter_map(nearest).collect())
}

/// An ellipse of pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Blob {
    /// Row and column of its middle pixel.
    pub pixel: [usize; 2],
    /// Half its height and half its width, pixels.
    pub radii_px: [f64; 2],
    /// Number that its pixels get.
    pub number: i32,
}

/// Paints blobs, one after another, each over the pixels of its surface alone: those with the same
/// value in `surfaces` as its middle.
///
/// # Arguments
/// * `masks` - row-major, `width_px` a row; changed.
/// * `surfaces` - instance of each pixel.
///
/// # Errors
/// [`Error::InvalidArgument`] if the images differ in size or are not whole rows, or a blob's
/// middle is outside or its radius not finite.
///
/// # Complexity
/// O(pixels of the blobs' boxes).
pub fn paint_blobs(
    masks: &mut [i32],
    surfaces: &[i32],
    width_px: usize,
    blobs: &[Blob],
) -> Result<(), Error> {
    if width_px == 0 || !masks.len().is_multiple_of(width_px) {
        return Err(Error::invalid("masks", masks.len(), "whole rows of pixels"));
    }
    Error::require("surfaces", surfaces.len(), "one value a pixel of the masks", |n| {
        n == masks.len()
    })?;
    let height_px = masks.len() / width_px;
    for blob in blobs {
        let [row, col] = blob.pixel;
        if row >= height_px || col >= width_px {
            return Err(Error::invalid("pixel", format!("{row}, {col}"), "inside the image"));
        }
        for radius in blob.radii_px {
            Error::require("radii_px", radius, "finite and > 0", |v| v.is_finite() && v > 0.0)?;
        }
        let surface = surfaces[row * width_px + col];
        let reach = |at: usize, radius: f64, end: usize| {
            let radius = radius.ceil() as usize; // saturates
            at.saturating_sub(radius)..at.saturating_add(radius).saturating_add(1).min(end)
        };
        for r in reach(row, blob.radii_px[0], height_px) {
            for c in reach(col, blob.radii_px[1], width_px) {
                let down = (r as f64 - row as f64) / blob.radii_px[0];
                let right = (c as f64 - col as f64) / blob.radii_px[1];
                let index = r * width_px + c;
                if down * down + right * right <= 1.0 && surfaces[index] == surface {
                    masks[index] = blob.number;
                }
            }
        }
    }
    Ok(())
}

/// Pixels with a pixel of something else beside them, above or below.
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

/// A checked image of masks.
struct Image {
    width_px: usize,
    height_px: usize,
}

impl Image {
    fn new(masks: &[i32], width_px: usize, num_masks: usize) -> Result<Self, Error> {
        if width_px == 0 || !masks.len().is_multiple_of(width_px) {
            return Err(Error::invalid("masks", masks.len(), "whole rows of pixels"));
        }
        for (mask, _) in runs(masks) {
            Error::require("masks", mask, "negative or the index of a detection", |mask| {
                usize::try_from(mask).is_ok_and(|mask| mask < num_masks) || mask < 0
            })?;
        }
        Ok(Self { width_px, height_px: masks.len() / width_px })
    }

    /// The four pixels beside one; `None` past the image's border.
    fn beside(&self, index: usize) -> [Option<usize>; 4] {
        let (row, col) = (index / self.width_px, index % self.width_px);
        [
            (col > 0).then(|| index - 1),
            (col + 1 < self.width_px).then_some(index + 1),
            (row > 0).then(|| index - self.width_px),
            (row + 1 < self.height_px).then_some(index + self.width_px),
        ]
    }

    /// Calls back with each pixel within a radius, and its squared distance.
    fn around(&self, index: usize, radius_px: f64, mut call: impl FnMut(usize, u32)) {
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
