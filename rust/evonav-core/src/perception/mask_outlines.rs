//! Measure the outlines of masks, and how much of them is cut by nearer surfaces.

use crate::{Error, perception::mask_image::MaskImage};

/// The outline of a mask compared with the depth around it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Outline {
    /// Number of sides of its pixels with no pixel of the mask on the other side.
    pub num_sides: usize,
    /// Number of those sides where the outline is cut: something nearer begins there, or the image
    /// ends.
    pub num_cut: usize,
    /// Mean planar depth of its pixels that have one, metres; infinite if none has.
    pub mean_depth_m: f64,
}

/// Measure the outline of each mask, and how much of it is cut by something nearer or by the
/// image's border. This is a cheap indication of occlusion that needs no second rendering.
///
/// Something is nearer if its depth is smaller by more than 5 cm and 5% of the mask's own. The
/// surface on which an object stands is not nearer where they meet.
///
/// # Arguments
/// * `masks` - row-major, `width_px` per row; negative where nothing is.
/// * `depth_m` - depth of the same pixels.
/// * `num_masks` - masks are numbered from 0 to one less than this.
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
    let image = MaskImage::new(masks, width_px, num_masks)?;
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
