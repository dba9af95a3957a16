//! Lit surfaces.
//!
//! Every block of pixels is computed once for each face in it: the points on the face, the colour
//! of its surface there, and the light that falls on them.

use crate::{
    sensors::raster::{
        canvas::{Canvas, LANES},
        lens::{Lens, Rays},
        light::Light,
        shader::{
            bends::{Bends, Shades},
            edges::Edges,
            flat::to_byte,
            surface::{Lanes, Patch},
        },
    },
    world::mesh::SceneMesh,
};

/// Colour behind windows and missing walls.
const SKY: [u8; 3] = [204, 222, 236];

/// Sunlight, times the lamps' and the sky's.
const SUN: [f32; 3] = [1.25, 1.18, 1.05];
/// Darkness of corners, most of which is in the light.
const SHADES: Shades = Shades { corner: 0.24, line: None };
/// Light in views without a house around them.
const EVEN: f32 = 0.85;
/// The response `x (a + b x - c x^2)` to brightness `x`: more contrast in the middle than at both ends.
const RESPONSE: [f32; 3] = [0.80, 0.55, 0.40];
/// Brightness at which the response is greatest.
const BRIGHTEST: f32 = 1.39;
/// Exposure: brightness of a white surface in light of 1.
const EXPOSURE: f32 = 0.88;

/// Working memory.
#[derive(Debug, Clone, Default)]
pub(super) struct Lit {
    bends: Bends,
    edges: Edges,
}

/// The parts of a view that all blocks share.
struct Shot<'a> {
    mesh: &'a SceneMesh,
    light: Option<&'a Light>,
    rays: Rays,
}

impl Lit {
    pub fn shade(
        &mut self,
        mesh: &SceneMesh,
        light: Option<&Light>,
        lens: &Lens,
        canvas: &Canvas,
        rgb: &mut [u8],
    ) {
        let shot = Shot { mesh, light, rays: lens.rays() };
        for (row, pixels) in rgb.chunks_exact_mut(3 * canvas.width_px).enumerate() {
            self.bends.darken(canvas, row, lens.optics, SHADES);
            let (whole, rest) = pixels.as_chunks_mut::<{ 3 * LANES }>();
            for (block, shades) in self.bends.light.as_chunks().0.iter().enumerate() {
                let colours = shot.block(canvas, [row, block], shades);
                match whole.get_mut(block) {
                    Some(pixels) => pixels.copy_from_slice(colours.as_flattened()),
                    None => rest.copy_from_slice(&colours.as_flattened()[..rest.len()]),
                }
            }
        }
        self.edges.smooth(canvas, rgb);
    }
}

impl Shot<'_> {
    /// Return the colours of a block.
    fn block(&self, canvas: &Canvas, [row, block]: [usize; 2], shades: &Lanes) -> [[u8; 3]; LANES] {
        let index = canvas.row_blocks(row).start + block;
        let tags = &canvas.tags[index];
        let (position_m, footprint_m) = self.rays.points(row, block, &canvas.nearness[index]);
        // Most blocks lie within one face.
        if tags[0] > 0 && tags.iter().fold(0, |different, tag| different | (tag ^ tags[0])) == 0 {
            let patch = Patch { face: tags[0] as usize - 1, position_m, footprint_m };
            return self.patch(&patch, [0, LANES - 1], shades);
        }
        let mut colours = [SKY; LANES];
        let mut rest = [true; LANES];
        for first in 0..LANES {
            let tag = tags[first];
            if !rest[first] || tag == 0 {
                continue;
            }
            let mut last = first;
            for lane in first..LANES {
                if tags[lane] == tag {
                    last = lane;
                    rest[lane] = false;
                }
            }
            let patch = Patch { face: tag as usize - 1, position_m, footprint_m };
            let found = self.patch(&patch, [first, last], shades);
            for lane in first..=last {
                if tags[lane] == tag {
                    colours[lane] = found[lane];
                }
            }
        }
        colours
    }

    /// Return the colours of a block as if one face covered it; `ends` are its first and last pixel
    /// that the face does cover.
    #[inline(always)]
    fn patch(&self, patch: &Patch, ends: [usize; 2], shades: &Lanes) -> [[u8; 3]; LANES] {
        let light = self.light_on(patch, ends);
        let surface = patch.colours(self.mesh, &self.rays);
        let channels: [[u32; LANES]; 3] = std::array::from_fn(|channel| {
            std::array::from_fn(|lane| {
                let [a, b, c] = RESPONSE;
                let x = surface[channel][lane] * light[channel][lane] * shades[lane];
                let x = (x * (EXPOSURE / 255.0)).min(BRIGHTEST);
                to_byte(255.0 * x * (a + x * (b - c * x)))
            })
        });
        std::array::from_fn(|lane| channels.map(|channel| channel[lane] as u8))
    }

    /// Return the light on a block: the square root of its strength, since colours are too.
    #[inline(always)]
    fn light_on(&self, patch: &Patch, [first, last]: [usize; 2]) -> [Lanes; 3] {
        let Some(light) = self.light else {
            return [[EVEN; LANES]; 3];
        };
        let face = &light.field.faces[patch.face];
        let at = |lane: usize| light.field.at(face, patch.position_m.map(|axis| axis[lane]));
        let (start, end) = (at(first), at(last));
        let share = 1.0 / (last - first).max(1) as f32;
        let between = |channel: usize| -> Lanes {
            let step = (end[channel] - start[channel]) * share;
            std::array::from_fn(|lane| start[channel] + step * (lane as f32 - first as f32))
        };
        if start[3] + end[3] <= 0.0 {
            return std::array::from_fn(|channel| {
                let (start, end) = (start[channel].sqrt(), end[channel].sqrt());
                let step = (end - start) * share;
                std::array::from_fn(|lane| start + step * (lane as f32 - first as f32))
            });
        }
        let smooth: [Lanes; 3] = std::array::from_fn(between);
        let (reach, slope) = (light.sun.reaches(&patch.position_m), between(3));
        std::array::from_fn(|channel| {
            std::array::from_fn(|lane| {
                let sun = SUN[channel] * reach[lane] * slope[lane];
                (smooth[channel][lane] + sun).max(0.0).sqrt()
            })
        })
    }
}
