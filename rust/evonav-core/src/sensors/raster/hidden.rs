//! Parts that are hidden by what has been drawn before them: they are not drawn.

use std::ops::Range;

use crate::{
    sensors::raster::{
        canvas::{Canvas, LANES},
        lens::{Lens, Optics},
    },
    world::mesh::{PartMesh, SceneMesh, dot},
};

/// Rows of a tile, which is a block wide.
const TILE_ROWS: usize = 8;
/// Share by which all pixels of a tile must be nearer than a part, for the rounding of nearness.
const MARGIN: f64 = 1e-3;
/// Four times the rounding of a number of 32 bits: [`Canvas::fill`] adds four.
const ROUNDING: f64 = 2.5e-7;
/// Distance of the camera from a face's plane under which corners that are off the plane by their
/// rounding may matter.
const LEAST_HEIGHT_M: f64 = 1e-3;

/// The least nearness in each tile of a canvas, or less: pixels only get nearer, so that what was
/// found earlier stays a bound. Tiles are looked at again where the bound does not suffice.
#[derive(Debug, Clone, Default)]
pub(super) struct Hidden {
    least: Vec<f32>,
}

impl Hidden {
    /// Begin with a canvas of which nothing is known.
    pub fn begin(&mut self, canvas: &Canvas) {
        self.least.clear();
        self.least.resize(canvas.height_px.div_ceil(TILE_ROWS) * canvas.blocks_per_row(), 0.0);
    }

    /// Return whether no pixel of a part can be nearer than what is drawn. Orthographic views and
    /// parts that the near plane cuts are not examined.
    ///
    /// # Arguments
    /// * `nearest_m` - smallest planar depth of the part's box.
    #[inline(always)]
    pub fn hides(
        &mut self,
        canvas: &Canvas,
        mesh: &SceneMesh,
        part: &PartMesh,
        lens: &Lens,
        nearest_m: f64,
    ) -> bool {
        let Optics::Perspective { focal_px } = lens.optics else { return false };
        if nearest_m <= lens.clip_m[0] {
            return false;
        }
        let nearest = 1.0 / nearest_m;
        // The nearness of a face that is seen from the side is rounded by more.
        let steepest = 0.5 * MARGIN * nearest / (LANES as f64 * ROUNDING);
        let least_m = LEAST_HEIGHT_M.max(1.0 / (focal_px * steepest));
        let is_even = |index: usize| {
            let face = &mesh.faces[index];
            let height_m = dot(face.normal, lens.eye_m) - face.offset_m;
            height_m <= 0.0 || height_m >= least_m
        };
        let [columns, rows] = lens.box_px(&part.aabb);
        self.is_nearer(canvas, columns, rows, (nearest * (1.0 + MARGIN)) as f32)
            && part.faces.clone().all(is_even)
    }

    /// Return whether all drawn pixels of some columns and rows are nearer than a bound.
    #[inline(always)]
    fn is_nearer(
        &mut self,
        canvas: &Canvas,
        columns: Range<usize>,
        rows: Range<usize>,
        bound: f32,
    ) -> bool {
        let [drawn_rows, drawn_blocks] = canvas.drawn();
        let rows = rows.start.max(drawn_rows.start)..rows.end.min(drawn_rows.end);
        let first = (columns.start / LANES).max(drawn_blocks.start);
        let end = columns.end.div_ceil(LANES).min(drawn_blocks.end);
        if rows.is_empty() {
            return true;
        }
        for tile_row in rows.start / TILE_ROWS..rows.end.div_ceil(TILE_ROWS) {
            for block in first..end {
                let least = &mut self.least[tile_row * canvas.blocks_per_row() + block];
                if *least < bound {
                    *least = least_nearness(canvas, tile_row, block);
                    if *least < bound {
                        return false;
                    }
                }
            }
        }
        true
    }
}

/// Return the least nearness of a tile's pixels on which is drawn.
#[inline(always)]
fn least_nearness(canvas: &Canvas, tile_row: usize, block: usize) -> f32 {
    let [drawn, _] = canvas.drawn();
    let first = (tile_row * TILE_ROWS).max(drawn.start);
    let end = ((tile_row + 1) * TILE_ROWS).min(drawn.end);
    let mut least = [f32::INFINITY; LANES];
    for row in first..end {
        let nearness = &canvas.nearness[row * canvas.blocks_per_row() + block];
        for (least, &nearness) in least.iter_mut().zip(nearness) {
            *least = if nearness < *least { nearness } else { *least };
        }
    }
    // The last block of a row may go on beyond the image.
    let width = LANES.min(canvas.width_px - block * LANES);
    least[..width].iter().fold(f32::INFINITY, |a, &b| if b < a { b } else { a })
}
