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
}

/// The light that corners and silhouettes leave in one row, and the row continued at both ends.
#[derive(Debug, Clone, Default)]
pub(super) struct Bends {
    padded: Vec<f32>,
    pub light: Vec<f32>,
}

impl Bends {
    /// Set `light` for a row.
    #[inline(always)]
    pub fn darken(&mut self, canvas: &Canvas, row: usize, optics: Optics, shades: Shades) {
        let (corner_px, width) = (corner_reach_px(canvas), canvas.width_px);
        // Lanes beyond the row may hold anything.
        self.light.resize(canvas.blocks_per_row() * LANES, 1.0);
        self.pad(canvas.row(row), width, corner_px);
        let (light, centre) = (&mut self.light[..width], &canvas.row(row)[..width]);
        let row = |reach_px: usize, scale_px: f64| BentRow {
            centre,
            neighbours: neighbours(&self.padded, canvas, row, [corner_px, reach_px]),
            scale: scale_px as f32 / reach_px as f32,
        };
        let corner = |bend: f32| 1.0 - corner_shade(bend, shades.corner);
        let line = |most: f32| move |bend: f32| 1.0 - most * line_shade(bend);
        match optics {
            // A bend counts relative to depth, as a pixel's width grows with it.
            Optics::Perspective { focal_px } => {
                let unit = |nearness: f32| nearness + 1e-6;
                row(corner_px, focal_px).each(light, unit, |light, bend| *light = corner(bend));
                if let Some(line) = shades.line.map(line) {
                    row(1, focal_px).each(light, unit, |light, bend| *light *= line(bend));
                }
            }
            Optics::Orthographic { pixels_per_m } => {
                let unit = |_: f32| 1.0;
                row(corner_px, pixels_per_m).each(light, unit, |light, bend| *light = corner(bend));
                if let Some(line) = shades.line.map(line) {
                    row(1, pixels_per_m).each(light, unit, |light, bend| *light *= line(bend));
                }
            }
        }
    }

    /// Compute what is left of the light in corners in one row, [`u16::MAX`] times.
    ///
    /// Rows and columns count apart, unlike in [`Self::darken`], so that the darkness around a thing
    /// that stands close to a wall is even.
    ///
    /// # Arguments
    /// * `depth_m` - of the row's pixels in perspective views, 1 in orthographic ones.
    /// * `corner` - darkness in concave corners, 0 to 1.
    #[inline(always)]
    pub fn open(
        &mut self,
        canvas: &Canvas,
        row: usize,
        optics: Optics,
        depth_m: &[f32],
        corner: f32,
        open: &mut [u16],
    ) {
        let (Optics::Perspective { focal_px: scale_px }
        | Optics::Orthographic { pixels_per_m: scale_px }) = optics;
        let (width, reach_px) = (canvas.width_px, corner_reach_px(canvas));
        self.pad(canvas.row(row), width, reach_px);
        let neighbours = neighbours(&self.padded, canvas, row, [reach_px; 2]);
        let centre = &canvas.row(row)[..width];
        let unit = 0.5 * scale_px as f32 / reach_px as f32;
        let (open, depth_m) = (&mut open[..width], &depth_m[..width]);
        OpenRow { open, centre, neighbours, depth_m, unit, corner }.compute();
    }

    /// Copy a row and continue it on both sides linearly, as the planes there continue.
    #[inline(always)]
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

/// Nearness of a row's pixels and of what surrounds them.
struct BentRow<'a> {
    centre: &'a [f32],
    neighbours: [&'a [f32]; 4],
    scale: f32,
}

impl BentRow<'_> {
    /// Change each pixel's light by the bend of its surroundings.
    ///
    /// Nearness is linear on a plane. The bend is the difference of nearness between the
    /// surroundings and a plane, in `unit`s and relative to the neighbours' spacing.
    #[inline(always)]
    fn each(self, light: &mut [f32], unit: impl Fn(f32) -> f32, change: impl Fn(&mut f32, f32)) {
        let Self { centre, neighbours: [left, right, above, below], scale } = self;
        for i in 0..light.len() {
            let around = 0.25 * (left[i] + right[i] + above[i] + below[i]);
            change(&mut light[i], (around - centre[i]) / unit(centre[i]) * scale);
        }
    }
}

/// Sets `open` by the greater bend of each pixel's row and column.
struct OpenRow<'a> {
    open: &'a mut [u16],
    centre: &'a [f32],
    neighbours: [&'a [f32]; 4],
    depth_m: &'a [f32],
    unit: f32,
    corner: f32,
}

impl OpenRow<'_> {
    #[inline(always)]
    fn compute(self) {
        const WHOLE: f32 = 32767.0;
        let Self { open, centre, neighbours, depth_m, unit, corner } = self;
        let [left, right, above, below] = neighbours;
        let lesser = |a: f32, b: f32| if a < b { a } else { b };
        // The product of [`corner_shade`], one of whose factors is always 1.
        let share = |bend: f32| lesser(lesser(bend * (1.0 / FULL_BEND), 1.0), 1.8 - bend);
        for i in 0..open.len() {
            // The bend is relative to depth, as a pixel's width grows with it.
            let bend = |sum: f32| (0.5 * sum - centre[i]) * (unit * depth_m[i]);
            let (level, upright) =
                (share(bend(left[i] + right[i])), share(bend(above[i] + below[i])));
            let most = if level > upright { level } else { upright };
            let most = if most > 0.0 { most } else { 0.0 };
            // The whole number nearest to one of 15 bits, by the mantissa of a sum with 2^23. Unlike
            // a conversion it needs no treatment of numbers out of range.
            let whole = (WHOLE - corner * WHOLE * most + 8_388_608.0).to_bits() & 0x7fff;
            open[i] = (whole as u16) << 1;
        }
    }
}

/// Return the distance up to which a corner is dark.
fn corner_reach_px(canvas: &Canvas) -> usize {
    ((canvas.height_px as f64 * CORNER_REACH) as usize).max(2)
}

/// Return what lies to the left and right of, above and below each pixel of a row. Above the image
/// and below it, planes go on.
///
/// # Arguments
/// * `padded` - the row, continued by the first of the numbers.
/// * `reach_px` - how far away the neighbours are.
#[inline(always)]
fn neighbours<'a>(
    padded: &'a [f32],
    canvas: &'a Canvas,
    row: usize,
    [padding_px, reach_px]: [usize; 2],
) -> [&'a [f32]; 4] {
    let has_both = row >= reach_px && row + reach_px < canvas.height_px;
    let (above, below) = match has_both {
        true => (canvas.row(row - reach_px), canvas.row(row + reach_px)),
        false => (canvas.row(row), canvas.row(row)),
    };
    let (left, right) = (&padded[padding_px - reach_px..], &padded[padding_px + reach_px..]);
    [left, right, above, below].map(|row| &row[..canvas.width_px])
}

/// Return the darkness in a corner, `most` or less. A large bend is not a corner but a surface far behind an edge.
#[inline(always)]
fn corner_shade(bend: f32, most: f32) -> f32 {
    let is_corner = (1.8 - bend).clamp(0.0, 1.0);
    most * (bend / FULL_BEND).clamp(0.0, 1.0) * is_corner
}

/// Return the share of the darkness of a silhouette's line.
#[inline(always)]
fn line_shade(bend: f32) -> f32 {
    (bend - 1.0).clamp(0.0, 1.0)
}
