//! Surfaces of one colour each, with dark corners and, if wanted, lines around silhouettes.
//!
//! A face is lit from above and from one side so that the faces of a box differ, and by a lamp at
//! the camera, so that walls fade with angle.

use evonav_simd::Kernel;

use crate::{
    geometry::Vec3,
    sensors::raster::{
        canvas::{Canvas, LANES, shows_only},
        lens::Optics,
        shader::{
            bends::{Bends, Shades},
            response::write_pixels,
        },
    },
    world::mesh::{Face, dot},
};

/// Share of a face's light that comes from the camera.
const LAMP_SHARE: f32 = 0.36;
/// Darkness of a corner; `LINE_SHADE` is that of a silhouette's line.
const CORNER_SHADE: f32 = 0.38;
const LINE_SHADE: f32 = 0.30;
/// Brightness of black surfaces; without it their corners would be invisible.
pub(super) const BLACK: f32 = 22.0;
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

    #[inline(always)]
    fn numbers(&self) -> [f32; 4] {
        let [red, green, blue] = self.rgb;
        [self.facing, red, green, blue]
    }
}

/// Colours of the faces in view, and working memory for one row.
#[derive(Debug, Clone, Default)]
pub(super) struct Flat {
    /// Lit faces by tag; 0 is the background.
    faces: Vec<LitFace>,
    /// Size of the view for which `shortness` was computed.
    size_px: [usize; 2],
    optics: Option<Optics>,
    /// One over the length of each pixel's ray at depth 1; see [`Self::level_facing`] for
    /// orthographic views.
    shortness: Vec<[f32; LANES]>,
    bends: Bends,
    /// Colours of a row's pixels, a channel a byte.
    packed: Vec<[u32; LANES]>,
}

impl Flat {
    pub fn begin(&mut self, num_faces: usize, size_px: [usize; 2], optics: Optics) {
        self.faces.resize(num_faces + 1, LitFace::SKY);
        if (size_px, Some(optics)) == (self.size_px, self.optics) {
            return;
        }
        (self.size_px, self.optics) = (size_px, Some(optics));
        let (Optics::Perspective { focal_px: scale }
        | Optics::Orthographic { pixels_per_m: scale }) = optics;
        let (scale_px, [width, height]) = (scale as f32, size_px.map(|side| side as f32));
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

    /// Fill rows of `rgb` from a drawn canvas.
    pub fn shade(
        &mut self,
        canvas: &Canvas,
        optics: Optics,
        has_lines: bool,
        is_wanted: impl Fn(usize) -> bool,
        rgb: &mut [u8],
    ) {
        let shades = Shades { corner: CORNER_SHADE, line: has_lines.then_some(LINE_SHADE) };
        evonav_simd::compute(Shade { flat: self, canvas, optics, shades, is_wanted, rgb });
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

    /// Set a row's pixels. [`LitFace::facing`] times the camera's nearness over the length of the
    /// ray at depth 1 is the cosine between a plane's normal and the ray.
    #[inline(always)]
    fn paint(&mut self, canvas: &Canvas, row: usize, pixels: &mut [u8]) {
        let blocks = canvas.row_blocks(row);
        let Self { faces, packed, bends, shortness, .. } = self;
        packed.resize(blocks.len(), [0; LANES]);
        let (light, _) = bends.light.as_chunks::<LANES>();
        let (tags, nearness) = (&canvas.tags[blocks.clone()], &canvas.nearness[blocks.clone()]);
        let blocks = tags.iter().zip(nearness).zip(&shortness[blocks]).zip(light);
        for (packed, (((tags, nearness), shortness), light)) in packed.iter_mut().zip(blocks) {
            let [planes, channels @ ..] = numbers(faces, tags);
            let mut lit = [0.0; LANES];
            for i in 0..LANES {
                let facing = nearness[i] * shortness[i];
                lit[i] = light[i] * (1.0 - LAMP_SHARE + LAMP_SHARE * planes[i] * facing);
            }
            *packed = [0; LANES];
            for (shift, channel) in [0, 8, 16].into_iter().zip(channels) {
                for i in 0..LANES {
                    packed[i] |= to_byte(channel[i] * lit[i]) << shift;
                }
            }
        }
        write_pixels(packed.as_flattened(), pixels);
    }
}

/// Return [`LitFace::numbers`] of the faces of a block's pixels. Most blocks lie within one face.
#[inline(always)]
fn numbers(faces: &[LitFace], tags: &[u32; LANES]) -> [[f32; LANES]; 4] {
    if shows_only(tags, tags[0]) {
        return faces[tags[0] as usize].numbers().map(|number| [number; LANES]);
    }
    let mut found = [[0.0; LANES]; 4];
    for (i, &tag) in tags.iter().enumerate() {
        for (lanes, number) in found.iter_mut().zip(faces[tag as usize].numbers()) {
            lanes[i] = number;
        }
    }
    found
}

/// [`Flat::shade`] and its arguments.
struct Shade<'a, F> {
    flat: &'a mut Flat,
    canvas: &'a Canvas,
    optics: Optics,
    shades: Shades,
    is_wanted: F,
    rgb: &'a mut [u8],
}

impl<F: Fn(usize) -> bool> Kernel for Shade<'_, F> {
    type Output = ();

    #[inline(always)]
    fn compute(self) {
        let Self { flat, canvas, optics, shades, is_wanted, rgb } = self;
        let rows = rgb.chunks_exact_mut(3 * canvas.width_px).enumerate();
        for (row, pixels) in rows.filter(|(row, _)| is_wanted(*row)) {
            flat.bends.darken(canvas, row, optics, shades);
            if let Optics::Orthographic { .. } = optics {
                flat.level_facing(canvas, row);
            }
            flat.paint(canvas, row, pixels);
        }
    }
}

/// Round a number of 0 or more, at most 255. The mantissa of a sum with 2^23 is used, which unlike a
/// conversion needs no treatment of numbers out of range.
#[inline(always)]
fn to_byte(value: f32) -> u32 {
    let value = if value < 255.0 { value } else { 255.0 };
    (value + 8_388_608.0).to_bits() & 0xff
}

/// Direction of the weaker light.
const SIDE: Vec3 = [0.64, 0.0, 0.77];
