//! Surfaces of one colour each, with dark corners and, if outlined, lines around silhouettes.
//!
//! A face is lit from above and from one side so that the faces of a box differ, and by a lamp at
//! the camera, so that walls fade with angle.

use crate::{
    geometry::Vec3,
    sensors::raster::{
        canvas::{Canvas, LANES},
        lens::Optics,
        shader::bends::{Bends, Shades},
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
        let rows = rgb.chunks_exact_mut(3 * canvas.width_px).enumerate();
        for (row, pixels) in rows.filter(|(row, _)| is_wanted(*row)) {
            self.bends.darken(canvas, row, optics, shades);
            if let Optics::Orthographic { .. } = optics {
                self.level_facing(canvas, row);
            }
            self.paint(canvas, row, pixels);
        }
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
            tags.iter().zip(depths).zip(self.bends.light.as_chunks().0)
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
pub(super) fn to_byte(value: f32) -> u32 {
    (value.min(255.0) + 8_388_608.0).to_bits()
}

/// Direction of the weaker light.
const SIDE: Vec3 = [0.64, 0.0, 0.77];
