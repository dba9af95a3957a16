//! Glass that is seen through, in colours alone: what is behind it is drawn in its place, and its
//! own colour is laid over that. Depth and instances show the glass, as AI2-THOR's do.

use std::ops::Range;

use crate::{
    sensors::raster::{
        canvas::{Canvas, LANES, shows_only},
        lens::Rays,
    },
    world::mesh::SceneMesh,
};

/// Colour of what glass reflects, and its share in sixteenths.
const GLASS: [u8; 3] = [206, 220, 224];
const SHARE: u16 = 2;
/// Colour of the ground outside the house.
const LAWN: [u8; 3] = [116, 146, 86];

/// The pixels of a picture that show glass.
#[derive(Debug, Clone, Default)]
pub(super) struct Panes {
    pixels: Vec<u32>,
}

impl Panes {
    /// Lay the colour of glass over what is seen through it.
    pub fn cover(&self, canvas: &Canvas, rays: &Rays, rgb: &mut [u8]) {
        let tags = canvas.tags.as_flattened();
        for &pixel in &self.pixels {
            let [row, column] =
                [pixel as usize / canvas.width_px, pixel as usize % canvas.width_px];
            let colour = &mut rgb[3 * pixel as usize..][..3];
            let is_empty = tags[row * canvas.blocks_per_row() * LANES + column] == 0;
            if is_empty && rays.is_below_horizon([column, row]) {
                colour.copy_from_slice(&LAWN);
            }
            for (channel, glass) in colour.iter_mut().zip(GLASS) {
                let mixed = u16::from(*channel) * (16 - SHARE) + u16::from(glass) * SHARE;
                *channel = (mixed / 16) as u8;
            }
        }
    }

    /// Note the pixels that show glass and clear them.
    ///
    /// # Returns
    /// The rows and the blocks of a row that contain them; `None` if there are none.
    pub fn clear(
        &mut self,
        mesh: &SceneMesh,
        empty: f32,
        canvas: &mut Canvas,
    ) -> Option<(Range<usize>, Range<usize>)> {
        self.forget();
        let (mut rows, mut blocks) = (canvas.height_px..0, canvas.blocks_per_row()..0);
        let mut last = (0, false);
        for row in 0..canvas.height_px {
            for (block, index) in canvas.row_blocks(row).enumerate() {
                let (tags, nearness) = (&mut canvas.tags[index], &mut canvas.nearness[index]);
                // Most blocks lie within the face of the block before.
                if !last.1 && shows_only(tags, last.0) {
                    continue;
                }
                for lane in 0..LANES.min(canvas.width_px - block * LANES) {
                    if tags[lane] != last.0 {
                        let face = (tags[lane] as usize).checked_sub(1);
                        last = (tags[lane], face.is_some_and(|face| mesh.is_pane(face)));
                    }
                    if last.1 {
                        (tags[lane], nearness[lane]) = (0, empty);
                        self.pixels.push((row * canvas.width_px + block * LANES + lane) as u32);
                        rows = rows.start.min(row)..row + 1;
                        blocks = blocks.start.min(block)..blocks.end.max(block + 1);
                    }
                }
            }
        }
        (!self.pixels.is_empty()).then_some((rows, blocks))
    }

    /// Forget the pixels of the picture before.
    pub fn forget(&mut self) {
        self.pixels.clear();
    }
}
