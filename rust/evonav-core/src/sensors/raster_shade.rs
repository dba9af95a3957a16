//! Colours after visibility: flat faces lit from above and from the camera, with drawn edges.

use crate::{
    sensors::raster_fill::{Canvas, LANES},
    world::mesh::{Face, dot},
};

/// Colours of the faces in view.
#[derive(Debug, Clone, Default)]
pub(super) struct Shader {
    /// Lit colour by face tag; 0 is the background.
    lit: Vec<[f32; 3]>,
}

impl Shader {
    pub fn begin(&mut self, num_faces: usize) {
        self.lit.resize(num_faces + 1, [0.0; 3]);
    }

    /// Lights a face: soft light from above, a weaker one from the side, so that the faces of a
    /// box differ.
    pub fn light(&mut self, index: usize, face: &Face) {
        let from_above = 0.5 + 0.5 * face.normal[1];
        let from_side = dot(face.normal, [0.64, 0.0, 0.77]);
        let light = (0.62 + 0.28 * from_above + 0.10 * from_side) as f32;
        self.lit[index + 1] = face.colour.map(|c| f32::from(c) * light);
    }

    pub fn shade(&self, canvas: &Canvas, rgb: &mut [u8]) {
        let blocks_per_row = canvas.blocks_per_row();
        for (row, pixels) in rgb.chunks_exact_mut(3 * canvas.width_px).enumerate() {
            let blocks = row * blocks_per_row..(row + 1) * blocks_per_row;
            let tags = &canvas.tags[blocks.clone()];
            let depths = &canvas.inverse_depth[blocks];
            for ((pixels, tags), inverse) in pixels.chunks_mut(3 * LANES).zip(tags).zip(depths) {
                for (lane, pixel) in pixels.chunks_exact_mut(3).enumerate() {
                    let fade = 0.75 + 0.25 * (2.0 * inverse[lane]).min(1.0);
                    let lit = self.lit[tags[lane] as usize];
                    for channel in 0..3 {
                        pixel[channel] = (lit[channel] * fade) as u8;
                    }
                }
            }
        }
    }
}
