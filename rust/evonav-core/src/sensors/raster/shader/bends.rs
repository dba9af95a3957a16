//! Darkness in concave corners and around silhouettes, from depth alone.

use crate::sensors::raster::{
    canvas::{Canvas, LANES},
    lens::Optics,
};

/// Width of the corners' darkness, as a share of the image's height.
const CORNER_REACH: f64 = 0.012;
/// Bend in the middle of a corner of a room.
const FULL_BEND: f32 = 0.7;

/// The greatest darkness, 0 to 1.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shades {
    /// Darkness in concave corners.
    pub corner: f32,
    /// Darkness of lines around silhouettes, if there are lines.
    pub line: Option<f32>,
    /// Whether rows and columns count apart, so that the darkness around a thing that stands close
    /// to a wall is even.
    pub is_even: bool,
}

/// The light that corners and silhouettes leave in one row, and the row continued at both ends.
#[derive(Debug, Clone, Default)]
pub(super) struct Bends {
    padded: Vec<f32>,
    pub light: Vec<f32>,
}

impl Bends {
    /// Set `light` for a row.
    pub fn darken(&mut self, canvas: &Canvas, row: usize, optics: Optics, shades: Shades) {
        let corner_px = ((canvas.height_px as f64 * CORNER_REACH) as usize).max(2);
        self.light.clear();
        self.light.resize(canvas.blocks_per_row() * LANES, 1.0);
        self.pad(canvas.row(row), canvas.width_px, corner_px);
        let (is_orthographic, scale_px) = match optics {
            Optics::Perspective { focal_px } => (false, focal_px as f32),
            Optics::Orthographic { pixels_per_m } => (true, pixels_per_m as f32),
        };
        let line = shades.line.map(|shade| (1, true, shade));
        for (reach_px, is_line, most) in
            [Some((corner_px, false, shades.corner)), line].into_iter().flatten()
        {
            let scale = scale_px / reach_px as f32;
            let centre = canvas.row(row);
            let has_both = row >= reach_px && row + reach_px < canvas.height_px;
            let (above, below) = match has_both {
                true => (canvas.row(row - reach_px), canvas.row(row + reach_px)),
                false => (centre, centre),
            };
            let left = &self.padded[corner_px - reach_px..];
            let right = &self.padded[corner_px + reach_px..];
            let width = canvas.width_px;
            let neighbours = [left, right, above, below].map(|row| &row[..width]);
            let (light, centre) = (&mut self.light[..width], &centre[..width]);
            if shades.is_even && !is_line {
                darken_evenly(light, centre, neighbours, [scale, most], is_orthographic);
                continue;
            }
            // In perspective views a bend counts relative to depth, as a pixel's width grows with it.
            let in_perspective = |nearness: f32| nearness + 1e-6;
            let orthographic = |_: f32| 1.0;
            match (is_line, is_orthographic) {
                (true, false) => {
                    darken_row(light, centre, neighbours, scale, in_perspective, |bend| {
                        most * line_shade(bend)
                    })
                }
                (false, false) => {
                    darken_row(light, centre, neighbours, scale, in_perspective, |bend| {
                        corner_shade(bend, most)
                    })
                }
                (true, true) => {
                    darken_row(light, centre, neighbours, scale, orthographic, |bend| {
                        most * line_shade(bend)
                    })
                }
                (false, true) => {
                    darken_row(light, centre, neighbours, scale, orthographic, |bend| {
                        corner_shade(bend, most)
                    })
                }
            }
        }
    }

    /// Copy a row and continue it on both sides linearly, as the planes there continue.
    fn pad(&mut self, row: &[f32], width_px: usize, reach_px: usize) {
        let row = &row[..width_px];
        let (first, last) = (row[0], row[width_px - 1]);
        let (second, one_but_last) = (row[1.min(width_px - 1)], row[width_px.saturating_sub(2)]);
        self.padded.clear();
        let ahead = (1..=reach_px).rev().map(|k| first + (first - second) * k as f32);
        self.padded.extend(ahead);
        self.padded.extend_from_slice(row);
        self.padded.extend((1..=reach_px).map(|k| last + (last - one_but_last) * k as f32));
    }
}

/// Darken `light` by the `shade` of the bend of each pixel's surroundings.
///
/// Nearness is linear on a plane. The bend is the difference of nearness between the surroundings
/// and a plane, in `unit`s and relative to the neighbours' spacing.
#[inline(always)]
fn darken_row(
    light: &mut [f32],
    centre: &[f32],
    [left, right, above, below]: [&[f32]; 4],
    scale: f32,
    unit: impl Fn(f32) -> f32,
    shade: impl Fn(f32) -> f32,
) {
    for i in 0..light.len() {
        let around = 0.25 * (left[i] + right[i] + above[i] + below[i]);
        let bend = (around - centre[i]) / unit(centre[i]) * scale;
        light[i] *= 1.0 - shade(bend);
    }
}

/// Darken `light` by the greater bend of each pixel's row and column, as [`darken_row`] does by
/// their mean.
#[inline(always)]
fn darken_evenly(
    light: &mut [f32],
    centre: &[f32],
    [left, right, above, below]: [&[f32]; 4],
    [scale, most]: [f32; 2],
    is_orthographic: bool,
) {
    for i in 0..light.len() {
        let unit = if is_orthographic { 1.0 } else { centre[i] + 1e-6 };
        let bend = |sum: f32| (0.5 * sum - centre[i]) * scale / unit;
        let shade = |sum: f32| corner_shade(0.5 * bend(sum), most);
        light[i] *= 1.0 - shade(left[i] + right[i]).max(shade(above[i] + below[i]));
    }
}

/// Return the darkness in a corner, `most` or less. A large bend is not a corner but a surface far behind an edge.
fn corner_shade(bend: f32, most: f32) -> f32 {
    let is_corner = (1.8 - bend).clamp(0.0, 1.0);
    most * (bend / FULL_BEND).clamp(0.0, 1.0) * is_corner
}

/// Return the share of the darkness of a silhouette's line.
fn line_shade(bend: f32) -> f32 {
    (bend - 1.0).clamp(0.0, 1.0)
}
