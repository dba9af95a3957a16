//! False detections: sites on surfaces where something is detected that does not exist.

use crate::{Error, rng::Stream, sensors::camera::Camera};

/// A site on a surface in view where something may be detected that does not exist.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Site {
    /// Row and column of the pixel nearest to the middle of the site.
    pub pixel: [usize; 2],
    /// Planar depth of the pixel, metres.
    pub depth_m: f64,
    /// Standard normal number: the lower it is, the more likely is a false detection here.
    pub latent: f64,
    /// Uniform numbers in 0..1, the same in every view of the site, for category and size.
    pub what: [f64; 2],
    /// Standard normal number of this view alone.
    pub how: f64,
}

/// Parameters of sites and the sources of their randomness.
#[derive(Debug, Clone)]
pub struct SiteNoise {
    /// Edge length of the sites, which are cells of a grid in the world, metres.
    pub cell_m: f64,
    /// Spacing of the pixels that are sampled, along rows and columns.
    pub stride_px: usize,
    /// Correlation of a site's latents in two views, 0 to 1.
    pub persistence: f64,
    /// Source of the numbers that are the same in every view, by site.
    pub lasting: Stream,
    /// Source of the numbers of one view, by site.
    pub passing: Stream,
}

/// Find the sites on the surfaces in view and draw their random numbers. These depend only on the
/// streams and the site, so that a false detection occurs again at the same site.
///
/// # Arguments
/// * `depth_m` - depth image of the camera.
///
/// # Returns
/// Sites in the order of their cells.
///
/// # Errors
/// [`Error::InvalidArgument`] if the image's size is not the camera's, or a parameter is outside its domain.
///
/// # Complexity
/// O(n log n) for n sampled pixels.
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
            // Far beyond the size of houses, cell indices would overflow.
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
    /// Half the height and half the width, pixels.
    pub radii_px: [f64; 2],
    /// Number written to its pixels.
    pub number: i32,
}

/// Paint blobs, one after another. Each covers only pixels of its own surface: those with the same
/// value in `surfaces` as its middle.
///
/// # Arguments
/// * `masks` - row-major, `width_px` per row; modified.
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
    Error::require_rows("masks", masks.len(), width_px)?;
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
