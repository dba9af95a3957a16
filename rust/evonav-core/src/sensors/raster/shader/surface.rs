//! The colour of surfaces before they are lit, and how it is lit, in numbers of 16 bits.

use crate::{
    sensors::raster::{canvas::LANES, lens::Lens, shader::flat::BLACK},
    textures::{NEUTRAL, Texture, texture_of},
    world::mesh::SceneMesh,
};

/// Share of a pixel's longer side on the surface that is averaged. A surface seen from the side
/// would lose all detail if it were 1, and shimmer if it were small.
const AVERAGED: f64 = 0.5;
/// Colours before they are lit, a grey level.
const FINE: f32 = 128.0;
/// Share of the range of colours that lies above the brightness of black surfaces.
const RAISED: f32 = 1.0 - BLACK / 255.0;

/// Red, green, blue and a number that is not used, for each pixel of a block.
pub(super) type Wide = [u16; 4 * LANES];
/// The same for two pixels: what one register of the plainest processors holds.
pub(super) type Pair = [u16; 8];

/// The surface of a face, prepared for one view.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Surface {
    texture: Option<&'static Texture>,
    /// The results of [`Lens::on_plane`] for the texture's coordinates.
    coordinates: [[f32; 3]; 2],
    /// Square of the texels in the width of a pixel at depth 1.
    detail: f32,
    /// Square of the ratio of a pixel's longer side on the surface to its width, at depth 1.
    slant: f32,
    /// Factors of a texture's channels.
    factor: Pair,
    /// Colours without a texture.
    plain: Pair,
}

impl Surface {
    pub fn of(mesh: &SceneMesh, index: usize, lens: &Lens, pixel: f32) -> Self {
        let (face, skin) = (&mesh.faces[index], &mesh.skins[index]);
        let texture = if skin.is_plain() { None } else { texture_of(skin.material) };
        let factor = |own: f32| (own * 256.0 * RAISED) as u16;
        let [red, green, blue] = face.colour.map(|channel| factor(f32::from(channel)));
        let factors = [red, green, blue, 0, red, green, blue, 0];
        let neutral = [(NEUTRAL * 256.0) as u16; 8];
        let plain =
            Self { factor: factors, plain: coloured(&neutral, &factors), ..Self::default() };
        let (Some(texture), Some((plane, facing))) = (texture, lens.nearness_plane(face)) else {
            return plain;
        };
        let coordinates = std::array::from_fn(|i| {
            let (along, origin) = (skin.axes[i].map(f64::from), f64::from(skin.origin[i]));
            // Whole repeats are left out: the numbers stay small.
            let repeats = lens.at_eye(along, origin).floor();
            lens.on_plane(plane, along, origin - repeats)
        });
        let per_m2 = skin.axes.map(|axis| axis.iter().map(|a| a * a).sum::<f32>());
        let texels = texture.size() as f32 * pixel;
        let factor = if skin.material.kind.is_picture() { [factor(NEUTRAL); 8] } else { factors };
        Self {
            texture: Some(texture),
            coordinates,
            detail: per_m2[0].max(per_m2[1]) * texels * texels,
            slant: (AVERAGED * AVERAGED / (facing * facing + 1e-9)) as f32,
            factor,
            plain: plain.plain,
        }
    }

    /// Return the colours of a run of pixels of a surface without a texture, [`FINE`] times.
    #[inline(always)]
    pub fn plain(&self) -> Option<Wide> {
        self.texture.is_none().then(|| wide(|_| self.plain))
    }

    /// Return the colours of a run of pixels that starts at `[column, row]`, [`FINE`] times.
    ///
    /// # Arguments
    /// * `scale` - depths; 1 in orthographic views.
    /// * `middle`, `length2` - the scale in the middle of the pixels that show the face, and the
    ///   result of [`Rays::length2`](crate::sensors::raster::lens::Rays::length2) there.
    #[inline(always)]
    pub fn colours(
        &self,
        [column, row]: [usize; 2],
        scale: &[f32; LANES],
        middle: f32,
        length2: f32,
    ) -> Wide {
        let Some(texture) = self.texture else { return wide(|_| self.plain) };
        let (first, row) = (column as f32 + 0.5, row as f32 + 0.5);
        let (mut u, mut v) = ([0.0; LANES], [0.0; LANES]);
        let [[du, u_down, u_at], [dv, v_down, v_at]] = self.coordinates;
        let (u_row, v_row) = (u_down * row + u_at, v_down * row + v_at);
        for lane in 0..LANES {
            let at = first + lane as f32;
            u[lane] = (du * at + u_row) * scale[lane];
            v[lane] = (dv * at + v_row) * scale[lane];
        }
        let middle2 = middle * middle;
        let width2 = self.detail * middle2 * (self.slant * middle2 * length2).max(1.0);
        let sums = texture.sample(&u, &v, width2);
        wide(|pair| coloured(&sums.as_chunks().0[pair], &self.factor))
    }
}

/// Return the colours of a surface with 256 times these factors of its own colour.
#[inline(always)]
fn coloured(sums: &Pair, factor: &Pair) -> Pair {
    const MOST: u16 = (255.0 * RAISED * FINE) as u16;
    const LEAST: u16 = (BLACK * FINE) as u16;
    products(sums, factor).map(|colour| colour.min(MOST) + LEAST)
}

/// Make a block of its pairs of pixels.
///
/// Compilers turn steps over pairs into one instruction each. Loops over whole blocks in which
/// channels or pixels repeat they leave as they are, which takes three times as long.
#[inline(always)]
pub(super) fn wide(pair: impl Fn(usize) -> Pair) -> Wide {
    let mut block = [0; 4 * LANES];
    for (index, channels) in block.as_chunks_mut().0.iter_mut().enumerate() {
        *channels = pair(index);
    }
    block
}

/// Return the products over 2^16.
#[inline(always)]
pub(super) fn products(a: &Pair, b: &Pair) -> Pair {
    let mut products = [0; 8];
    for (i, product) in products.iter_mut().enumerate() {
        *product = ((u32::from(a[i]) * u32::from(b[i])) >> 16) as u16;
    }
    products
}
