//! Faces, prepared for one view: how they are lit, and their textures.

use crate::{
    sensors::raster::{
        lens::Lens,
        light::Light,
        shader::{
            flat::BLACK,
            response::{FINE, MOST, product},
        },
    },
    textures::{NEUTRAL, Texture, texture_of},
    world::mesh::SceneMesh,
};

/// Share of a pixel's longer side on the surface that is averaged. A surface seen from the side
/// would lose all detail if it were 1, and shimmer if it were small.
const AVERAGED: f64 = 0.5;
/// Share of the range of colours that lies above the brightness of black surfaces.
const RAISED: f32 = 1.0 - BLACK / 255.0;
/// Exposure: brightness of a white surface in light of 1.
const EXPOSURE: f32 = 0.88;
/// The root of light of 1 on a textured surface as a number of 16 bits; it is below 8.
const ROOT: f32 = 8192.0;

/// A face, prepared for one view.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Surface {
    pub texture: Option<&'static Texture>,
    /// The results of [`Lens::on_plane`] for the texture's coordinates.
    coordinates: [[f32; 3]; 2],
    /// Square of the texels in the width of a pixel at depth 1.
    detail: f32,
    /// Square of the ratio of a pixel's longer side on the surface to its width, at depth 1.
    slant: f32,
    /// Factors of a texture's channels.
    factor: [u16; 3],
    /// The results of [`Lens::on_plane`] for the column and row in the face's grid of light.
    pub places: [[f32; 3]; 2],
    /// Factors of the root of light, by channel, and the greatest product. It is the brightness,
    /// [`FINE`] times, if the surface has no texture; else a number of 16 bits.
    pub scale: [f32; 4],
    pub most: f32,
}

impl Surface {
    /// Prepare a face.
    ///
    /// # Arguments
    /// * `pixel` - width of a pixel at depth 1.
    pub fn of(
        mesh: &SceneMesh,
        light: Option<&Light>,
        index: usize,
        lens: &Lens,
        pixel: f32,
    ) -> Self {
        let (face, skin) = (&mesh.faces[index], &mesh.skins[index]);
        let Some((plane, facing)) = lens.nearness_plane(face) else { return Self::default() };
        let places = match light.and_then(|light| light.field.of_face(mesh, index)) {
            Some(face) => face.axes().map(|[x, y, z, offset]| {
                lens.on_plane(plane, [x, y, z].map(f64::from), f64::from(offset))
            }),
            None => [[0.0; 3]; 2],
        };
        let texture = if skin.is_plain() { None } else { texture_of(skin.material) };
        let [red, green, blue] = face.colour.map(f32::from);
        let Some(texture) = texture else {
            let scale = |own: f32| EXPOSURE * FINE * (BLACK + own * RAISED);
            let scale = [scale(red), scale(green), scale(blue), 0.0];
            return Self { places, scale, most: f32::from(MOST), ..Self::default() };
        };
        let coordinates = std::array::from_fn(|i| {
            let (along, origin) = (skin.axes[i].map(f64::from), f64::from(skin.origin[i]));
            // Whole repeats are left out: the numbers stay small.
            let repeats = lens.at_eye(along, origin).floor();
            lens.on_plane(plane, along, origin - repeats)
        });
        let per_m2 = skin.axes.map(|axis| axis.iter().map(|a| a * a).sum::<f32>());
        let texels = texture.size() as f32 * pixel;
        let own = if skin.material.kind.is_picture() { [NEUTRAL; 3] } else { [red, green, blue] };
        Self {
            texture: Some(texture),
            coordinates,
            detail: per_m2[0].max(per_m2[1]) * texels * texels,
            slant: (AVERAGED * AVERAGED / (facing * facing + 1e-9)) as f32,
            factor: own.map(|own| (own * 256.0 * RAISED) as u16),
            places,
            scale: [EXPOSURE * ROOT; 4],
            most: f32::from(u16::MAX),
        }
    }

    /// Return the [`Texture::level`] at which a block of pixels is looked up.
    ///
    /// # Arguments
    /// * `middle`, `length2` - the depth in the middle of the pixels that show the face (1 in
    ///   orthographic views), and the result of
    ///   [`Rays::length2`](crate::sensors::raster::lens::Rays::length2) there.
    #[inline(always)]
    pub fn level(&self, texture: &Texture, middle: f32, length2: f32) -> usize {
        let middle2 = middle * middle;
        texture.level(self.detail * middle2 * (self.slant * middle2 * length2).max(1.0))
    }

    /// Set the texture's coordinates at pixels of a row from `[column, row]` on.
    ///
    /// # Arguments
    /// * `scale` - depths; 1 in orthographic views.
    #[inline(always)]
    pub fn coordinates(&self, [column, row]: [usize; 2], scale: &[f32], uv: [&mut [f32]; 2]) {
        let (first, row) = (column as f32 + 0.5, row as f32 + 0.5);
        for (coordinate, [du, u_down, u_at]) in uv.into_iter().zip(self.coordinates) {
            let u_row = u_down * row + u_at;
            for ((u, scale), place) in coordinate.iter_mut().zip(scale).zip(0_i32..) {
                *u = (du * (first + place as f32) + u_row) * scale;
            }
        }
    }

    /// Turn the root of the light on pixels into brightness.
    ///
    /// # Arguments
    /// * `sums` - what was looked up in the texture, for a channel.
    #[inline(always)]
    pub fn colour(&self, channel: usize, sums: &[u16], bright: &mut [u16]) {
        const WHITE: u16 = (255.0 * RAISED * FINE) as u16;
        const LEAST: u16 = (BLACK * FINE) as u16;
        let factor = self.factor[channel];
        for (bright, sum) in bright.iter_mut().zip(sums) {
            let own = product(*sum, factor).min(WHITE) + LEAST;
            *bright = product(2 * own, *bright).min(MOST / 4) * 4;
        }
    }
}
