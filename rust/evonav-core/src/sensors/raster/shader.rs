//! Compute colours after visibility.
//!
//! A face has one colour, lit from above and from one side so that the faces of a box differ. In
//! addition, each pixel is shaded from depth alone: by a lamp at the camera, so that walls fade
//! with angle; by darkness in concave corners and where objects stand; and by a thin line around
//! silhouettes.

use crate::{
    geometry::Vec3,
    sensors::raster::{
        canvas::{Canvas, LANES},
        lens::Optics,
    },
    world::mesh::{Face, dot},
};

/// Width of the corners' darkness, as a share of the image's height.
const CORNER_REACH: f64 = 0.012;
/// Darkness of a corner; `LINE_SHADE` is that of a silhouette's line.
const CORNER_SHADE: f32 = 0.38;
const LINE_SHADE: f32 = 0.30;
/// Bend in the middle of a corner of a room.
const FULL_BEND: f32 = 0.7;
/// Share of a face's light that comes from the camera.
const LAMP_SHARE: f32 = 0.36;
/// Brightness of black surfaces; without it their corners would be invisible.
const BLACK: f32 = 22.0;
/// Colour behind windows and missing walls, before the lamp's share is subtracted.
const SKY: [f32; 3] =
    [204.0 / (1.0 - LAMP_SHARE), 222.0 / (1.0 - LAMP_SHARE), 236.0 / (1.0 - LAMP_SHARE)];

/// A face as it is lit in this view.
#[derive(Debug, Clone, Copy)]
struct LitFace {
    rgb: [f32; 3],
    /// Distance of its plane from the camera; in orthographic views the cosine between its normal
    /// and the viewing direction.
    facing: f32,
}

impl LitFace {
    const SKY: Self = Self { rgb: SKY, facing: 0.0 };
}

/// Colours of the faces in view, and working memory for one row.
#[derive(Debug, Clone, Default)]
pub(super) struct Shader {
    /// Lit faces by tag; 0 is the background.
    faces: Vec<LitFace>,
    /// Size of the view for which `shortness` was computed.
    size_px: [usize; 2],
    optics: Option<Optics>,
    is_orthographic: bool,
    /// Pixels per metre; in perspective views at depth 1.
    scale_px: f32,
    /// One over the length of each pixel's ray at depth 1; see [`Self::level_facing`] for
    /// orthographic views.
    shortness: Vec<[f32; LANES]>,
    /// The current row, continued at both ends.
    padded: Vec<f32>,
    light: Vec<f32>,
}

impl Shader {
    pub fn begin(&mut self, num_faces: usize, size_px: [usize; 2], optics: Optics) {
        self.faces.resize(num_faces + 1, LitFace::SKY);
        if (size_px, Some(optics)) == (self.size_px, self.optics) {
            return;
        }
        (self.size_px, self.optics) = (size_px, Some(optics));
        (self.is_orthographic, self.scale_px) = match optics {
            Optics::Perspective { focal_px } => (false, focal_px as f32),
            Optics::Orthographic { pixels_per_m } => (true, pixels_per_m as f32),
        };
        let (scale_px, [width, height]) = (self.scale_px, size_px.map(|side| side as f32));
        let shortness = |row: usize, block: usize| {
            std::array::from_fn(|lane| {
                let right = ((block * LANES + lane) as f32 + 0.5 - width / 2.0) / scale_px;
                let down = (row as f32 + 0.5 - height / 2.0) / scale_px;
                1.0 / (1.0 + right * right + down * down).sqrt()
            })
        };
        let blocks = 0..size_px[0].div_ceil(LANES);
        let pixels = (0..size_px[1]).flat_map(|row| blocks.clone().map(move |b| (row, b)));
        self.shortness.clear();
        self.shortness.extend(pixels.map(|(row, block)| shortness(row, block)));
    }

    /// Light a face that may be seen; `facing` as [`LitFace::facing`].
    pub fn light(&mut self, index: usize, face: &Face, facing: f64) {
        let from_above = 0.5 + 0.5 * face.normal[1];
        let from_side = dot(face.normal, SIDE);
        let light = (0.80 + 0.22 * from_above + 0.09 * from_side) as f32;
        let rgb = face.colour.map(|c| BLACK + f32::from(c) * (light - BLACK / 255.0));
        self.faces[index + 1] = LitFace { rgb, facing: facing as f32 };
    }

    /// Fill `rgb` from a drawn canvas.
    pub fn shade(&mut self, canvas: &Canvas, rgb: &mut [u8]) {
        for (row, pixels) in rgb.chunks_exact_mut(3 * canvas.width_px).enumerate() {
            self.darken(canvas, row);
            if self.is_orthographic {
                self.level_facing(canvas, row);
            }
            self.paint(canvas, row, pixels);
        }
    }

    /// Set `light` to the light that corners and silhouettes leave in a row.
    fn darken(&mut self, canvas: &Canvas, row: usize) {
        let corner_px = ((canvas.height_px as f64 * CORNER_REACH) as usize).max(2);
        self.light.clear();
        self.light.resize(canvas.blocks_per_row() * LANES, 1.0);
        self.pad(canvas.row(row), canvas.width_px, corner_px);
        for (reach_px, is_line) in [(corner_px, false), (1, true)] {
            let scale = self.scale_px / reach_px as f32;
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
            // In perspective views a bend counts relative to depth, as a pixel's width grows with it.
            let in_perspective = |nearness: f32| nearness + 1e-6;
            let orthographic = |_: f32| 1.0;
            match (is_line, self.is_orthographic) {
                (true, false) => {
                    darken_row(light, centre, neighbours, scale, in_perspective, line_shade)
                }
                (false, false) => {
                    darken_row(light, centre, neighbours, scale, in_perspective, corner_shade)
                }
                (true, true) => {
                    darken_row(light, centre, neighbours, scale, orthographic, line_shade)
                }
                (false, true) => {
                    darken_row(light, centre, neighbours, scale, orthographic, corner_shade)
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

    /// Set `shortness` so that nearness times `shortness` is 1 in a row: all rays are along the
    /// axis.
    fn level_facing(&mut self, canvas: &Canvas, row: usize) {
        let blocks = canvas.row_blocks(row);
        let nearness = &canvas.nearness[blocks.clone()];
        for (shortness, nearness) in self.shortness[blocks].iter_mut().zip(nearness) {
            *shortness = nearness.map(|w| 1.0 / w);
        }
    }

    fn paint(&self, canvas: &Canvas, row: usize, pixels: &mut [u8]) {
        let blocks = canvas.row_blocks(row);
        let (whole, rest) = pixels.as_chunks_mut::<{ 3 * LANES }>();
        let mut whole = whole.iter_mut();
        let tags = &canvas.tags[blocks.clone()];
        let depths = canvas.nearness[blocks.clone()].iter().zip(&self.shortness[blocks]);
        for ((tags, (nearness, shortness)), lights) in
            tags.iter().zip(depths).zip(self.light.as_chunks().0)
        {
            let facing = std::array::from_fn(|lane| nearness[lane] * shortness[lane]);
            let rgb = self.colours(tags, &facing, lights);
            match whole.next() {
                Some(pixels) => pixels.copy_from_slice(rgb.as_flattened()),
                None => rest.copy_from_slice(&rgb.as_flattened()[..rest.len()]),
            }
        }
    }

    /// Compute the colours of a block. `facing` is inverse depth over the length of the ray at
    /// depth 1. Multiplied by the camera's distance from a plane, it is the cosine between the
    /// plane's normal and the ray. In orthographic views, where faces contain that cosine, it is 1.
    fn colours(
        &self,
        tags: &[u32; LANES],
        facing: &[f32; LANES],
        lights: &[f32; LANES],
    ) -> [[u8; 3]; LANES] {
        let lit = |face: &LitFace, lane: usize| {
            lights[lane] * (1.0 - LAMP_SHARE + LAMP_SHARE * face.facing * facing[lane])
        };
        // Most blocks lie within one face.
        if tags.iter().all(|&tag| tag == tags[0]) {
            let face = self.faces[tags[0] as usize];
            let light: [f32; LANES] = std::array::from_fn(|lane| lit(&face, lane));
            let channels = face.rgb.map(|channel| light.map(|light| to_byte(channel * light)));
            return std::array::from_fn(|lane| channels.map(|channel| channel[lane] as u8));
        }
        std::array::from_fn(|lane| {
            let face = &self.faces[tags[lane] as usize];
            face.rgb.map(|channel| to_byte(channel * lit(face, lane)) as u8)
        })
    }
}

/// Round a number of 0 or more to the low byte of the result, at most 255. The mantissa of a sum
/// with 2^23 is used, which unlike a conversion needs no treatment of numbers out of range.
fn to_byte(value: f32) -> u32 {
    (value.min(255.0) + 8_388_608.0).to_bits()
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

/// Return the darkness in a corner. A large bend is not a corner but a surface far behind an edge.
fn corner_shade(bend: f32) -> f32 {
    let is_corner = (1.8 - bend).clamp(0.0, 1.0);
    CORNER_SHADE * (bend / FULL_BEND).clamp(0.0, 1.0) * is_corner
}

/// Return the darkness of a silhouette's line.
fn line_shade(bend: f32) -> f32 {
    LINE_SHADE * (bend - 1.0).clamp(0.0, 1.0)
}

/// Direction of the weaker light.
const SIDE: Vec3 = [0.64, 0.0, 0.77];
