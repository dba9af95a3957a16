//! Lit surfaces.
//!
//! Every block of pixels is computed once for each face in it: the points on the face, the colour
//! of its surface there, and the light that falls on them.

use crate::{
    geometry::Vec3,
    sensors::raster::{
        canvas::{Canvas, LANES},
        lens::{Lens, Rays},
        shader::{
            bends::Bends,
            flat::to_byte,
            surface::{Lanes, Patch},
        },
    },
    world::mesh::SceneMesh,
};

/// Colour behind windows and missing walls.
const SKY: [u8; 3] = [204, 222, 236];

/// A face in view.
#[derive(Debug, Clone, Copy, Default)]
struct Seen {
    /// Distance of its plane from the camera; in orthographic views the cosine between its normal
    /// and the viewing direction.
    facing: f32,
}

/// The faces in view, and working memory.
#[derive(Debug, Clone, Default)]
pub(super) struct Lit {
    faces: Vec<Seen>,
    bends: Bends,
}

impl Lit {
    pub fn begin(&mut self, num_faces: usize) {
        self.faces.resize(num_faces, Seen::default());
    }

    pub fn note(&mut self, index: usize, _plane: Vec3, facing: f64) {
        self.faces[index] = Seen { facing: facing as f32 };
    }

    pub fn shade(&mut self, mesh: &SceneMesh, lens: &Lens, canvas: &Canvas, rgb: &mut [u8]) {
        let rays = lens.rays();
        for (row, pixels) in rgb.chunks_exact_mut(3 * canvas.width_px).enumerate() {
            self.bends.darken(canvas, row, lens.optics, false);
            let (whole, rest) = pixels.as_chunks_mut::<{ 3 * LANES }>();
            for block in 0..canvas.blocks_per_row() {
                let colours = self.block(mesh, &rays, canvas, [row, block]);
                match whole.get_mut(block) {
                    Some(pixels) => pixels.copy_from_slice(colours.as_flattened()),
                    None => rest.copy_from_slice(&colours.as_flattened()[..rest.len()]),
                }
            }
        }
    }

    fn block(
        &self,
        mesh: &SceneMesh,
        rays: &Rays,
        canvas: &Canvas,
        [row, block]: [usize; 2],
    ) -> [[u8; 3]; LANES] {
        let index = canvas.row_blocks(row).start + block;
        let tags = &canvas.tags[index];
        let (position_m, footprint_m) = rays.points(row, block, &canvas.nearness[index]);
        let mut colours = [SKY; LANES];
        let mut lane = 0;
        while lane < LANES {
            let tag = tags[lane];
            let is_first = tag > 0 && !tags[..lane].contains(&tag);
            if is_first {
                let face = tag as usize - 1;
                let patch = Patch { face, position_m, footprint_m };
                let found = self.patch(mesh, rays, &patch, &canvas.nearness[index], block);
                for (colour, found) in colours
                    .iter_mut()
                    .zip(found)
                    .zip(tags)
                    .filter_map(|(pair, &other)| (other == tag).then_some(pair))
                {
                    *colour = found;
                }
            }
            lane += 1;
        }
        colours
    }

    #[inline(always)]
    fn patch(
        &self,
        mesh: &SceneMesh,
        rays: &Rays,
        patch: &Patch,
        nearness: &Lanes,
        block: usize,
    ) -> [[u8; 3]; LANES] {
        let _ = (rays, nearness, self.faces[patch.face].facing);
        let normal = mesh.faces[patch.face].normal;
        let level = (0.8 + 0.2 * normal[1] + 0.06 * normal[0]) as f32;
        let shades = &self.bends.light[block * LANES..][..LANES];
        let channels = patch.colours(mesh, rays).map(|channel| {
            std::array::from_fn::<_, LANES, _>(|lane| to_byte(channel[lane] * level * shades[lane]))
        });
        std::array::from_fn(|lane| channels.map(|channel| channel[lane] as u8))
    }
}
