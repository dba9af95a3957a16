//! The colour of surfaces before they are lit.

use crate::{
    sensors::raster::{canvas::LANES, lens::Rays, shader::flat::BLACK},
    textures::{NEUTRAL, Texture, channels_of, texture_of},
    world::{mesh::SceneMesh, skin::Skin},
};

/// Share of a pixel's longer side on the surface that is averaged. A surface seen from the side
/// would lose all detail if it were 1, and shimmer if it were small.
const AVERAGED: f32 = 0.5;

/// A value for each pixel of a block.
pub(super) type Lanes = [f32; LANES];

/// A block of pixels as if one face covered all of them; those of other faces are ignored later.
pub(super) struct Patch {
    /// Index of the face.
    pub face: usize,
    /// World points `x, y, z` on the surface.
    pub position_m: [Lanes; 3],
    /// Width of a pixel at the surface, across the ray.
    pub footprint_m: Lanes,
}

impl Patch {
    /// Return the colour of each pixel, sRGB, 0 to 255.
    #[inline(always)]
    pub fn colours(&self, mesh: &SceneMesh, rays: &Rays) -> [Lanes; 3] {
        let colour = mesh.faces[self.face].colour.map(f32::from);
        let skin = &mesh.skins[self.face];
        let texture = if skin.is_plain() { None } else { texture_of(skin.material) };
        let raised = |c: f32| BLACK + c * (1.0 - BLACK / 255.0);
        let Some(texture) = texture else {
            return colour.map(|c| [raised(c); LANES]);
        };
        let factors = self.factors(mesh, rays, skin, texture);
        let is_picture = skin.material.kind.is_picture();
        std::array::from_fn(|i| {
            let own = if is_picture { 1.0 } else { colour[i] / NEUTRAL };
            factors[i].map(|factor| raised((own * factor).min(255.0)))
        })
    }

    /// Return the texture's channels at each pixel.
    #[inline(always)]
    fn factors(&self, mesh: &SceneMesh, rays: &Rays, skin: &Skin, texture: &Texture) -> [Lanes; 4] {
        let [x, y, z] = &self.position_m;
        let [u, v]: [Lanes; 2] = std::array::from_fn(|i| {
            let ([du, dv, dw], origin) = (skin.axes[i], skin.origin[i]);
            std::array::from_fn(|k| du * x[k] + dv * y[k] + dw * z[k] + origin)
        });
        let width = self.width2(mesh.faces[self.face].normal.map(|n| n as f32), rays);
        let per_m2 = skin.axes.map(|axis| axis.iter().map(|a| a * a).sum::<f32>());
        let scale = per_m2[0].max(per_m2[1]) * (texture.size() * texture.size()) as f32;
        let mixed: [u64; LANES] =
            std::array::from_fn(|k| texture.sample(u[k], v[k], width[k] * scale));
        let apart = mixed.map(channels_of);
        std::array::from_fn(|i| apart.map(|texel| texel[i]))
    }

    /// Return the square of the width, on the surface, of what each pixel averages.
    #[inline(always)]
    fn width2(&self, normal: [f32; 3], rays: &Rays) -> Lanes {
        let [x, y, z] = &self.position_m;
        let eye_m = rays.eye_m();
        std::array::from_fn(|k| {
            let to_eye = [eye_m[0] - x[k], eye_m[1] - y[k], eye_m[2] - z[k]];
            let length2: f32 =
                to_eye[0] * to_eye[0] + to_eye[1] * to_eye[1] + to_eye[2] * to_eye[2];
            let facing = to_eye[0] * normal[0] + to_eye[1] * normal[1] + to_eye[2] * normal[2];
            let longer = AVERAGED * AVERAGED * length2 / (facing * facing + 1e-9);
            self.footprint_m[k] * self.footprint_m[k] * longer.max(1.0)
        })
    }
}
