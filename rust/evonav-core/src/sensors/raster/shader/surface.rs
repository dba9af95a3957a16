//! The colour of surfaces before they are lit.

use crate::{sensors::raster::canvas::LANES, world::mesh::SceneMesh};

/// Brightness of black surfaces; without it their form would be invisible.
const BLACK: f32 = 22.0;

/// A value for each pixel of a block.
pub(super) type Lanes = [f32; LANES];

/// A block of pixels as if one face covered all of them; those of other faces are ignored later.
pub(super) struct Patch {
    /// Index of the face.
    pub face: usize,
    /// World points `x, y, z` on the surface.
    #[expect(dead_code, reason = "for patterns")]
    pub position_m: [Lanes; 3],
    /// Width of a pixel on the surface, along its longer side.
    #[expect(dead_code, reason = "for patterns")]
    pub footprint_m: Lanes,
}

impl Patch {
    /// Return the colour of each pixel, sRGB, 0 to 255.
    #[inline(always)]
    pub fn colours(&self, mesh: &SceneMesh) -> [Lanes; 3] {
        mesh.faces[self.face].colour.map(|c| [BLACK + f32::from(c) * (1.0 - BLACK / 255.0); LANES])
    }
}
