//! The inner loops of the rasteriser: draw convex polygons into a depth buffer.

use std::ops::Range;

use crate::geometry::{Vec2, Vec3};

/// Number of pixels that one step of the inner loops handles, in plain arrays, which compilers turn
/// into SIMD.
pub(super) const LANES: usize = 8;
const LANE_INDEX: [f32; LANES] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];

/// A depth buffer: nearness (inverse depth in perspective views) and a tag (0: nothing drawn) of
/// each pixel. Rows are padded to whole blocks.
#[derive(Debug, Clone, Default)]
pub(super) struct Canvas {
    pub width_px: usize,
    pub height_px: usize,
    pub nearness: Vec<[f32; LANES]>,
    pub tags: Vec<[u32; LANES]>,
    /// Rows, and blocks of a row, on which is drawn.
    drawn: [Range<usize>; 2],
    /// First pixel of the current polygon in each row; `right` has the one after its last.
    left: Vec<u32>,
    right: Vec<u32>,
}

impl Canvas {
    /// Clear the canvas. Surfaces that are not nearer than `empty` will not be drawn.
    pub fn clear(&mut self, width_px: usize, height_px: usize, empty: f32) {
        (self.width_px, self.height_px) = (width_px, height_px);
        let num_blocks = self.blocks_per_row() * height_px;
        self.nearness.clear();
        self.nearness.resize(num_blocks, [empty; LANES]);
        self.tags.clear();
        self.tags.resize(num_blocks, [0; LANES]);
        self.left.resize(height_px, 0);
        self.right.resize(height_px, 0);
        self.drawn = [0..height_px, 0..self.blocks_per_row()];
    }

    /// Clear some rows and blocks, and draw only on them until the canvas is cleared again. Their
    /// pixels get the same values as when the whole canvas is drawn.
    pub fn clear_within(
        &mut self,
        [width_px, height_px]: [usize; 2],
        empty: f32,
        rows: Range<usize>,
        blocks: Range<usize>,
    ) {
        (self.width_px, self.height_px) = (width_px, height_px);
        let num_blocks = self.blocks_per_row() * height_px;
        self.nearness.resize(num_blocks, [empty; LANES]);
        self.tags.resize(num_blocks, [0; LANES]);
        self.left.resize(height_px, 0);
        self.right.resize(height_px, 0);
        for row in rows.clone() {
            let first = self.row_blocks(row).start;
            self.nearness[first + blocks.start..first + blocks.end].fill([empty; LANES]);
            self.tags[first + blocks.start..first + blocks.end].fill([0; LANES]);
        }
        self.drawn = [rows, blocks];
    }

    /// Draw only on some rows and blocks until the canvas is cleared.
    pub fn draw_within(&mut self, rows: Range<usize>, blocks: Range<usize>) {
        self.drawn = [rows, blocks];
    }

    pub fn blocks_per_row(&self) -> usize {
        self.width_px.div_ceil(LANES)
    }

    /// Return the blocks of a row.
    pub fn row_blocks(&self, row: usize) -> Range<usize> {
        row * self.blocks_per_row()..(row + 1) * self.blocks_per_row()
    }

    /// Return the nearness of a row, its padding included.
    pub fn row(&self, row: usize) -> &[f32] {
        self.nearness[self.row_blocks(row)].as_flattened()
    }

    /// Draw a convex polygon, clockwise on the screen, where it is nearer than the pixels drawn so
    /// far. `plane` gives the nearness, which is positive, at `[u, v]`: `plane . [u, v, 1]`.
    ///
    /// A pixel is covered if its centre is inside. A centre on an edge belongs to the polygon to
    /// the right of or below that edge, so that neighbours neither overlap nor leave a gap.
    pub fn fill(&mut self, corners_px: &[Vec2], plane: Vec3, tag: u32) {
        let rows = self.scan(corners_px);
        let blocks_per_row = self.blocks_per_row();
        let step = plane[0] as f32;
        for row in rows {
            let (left, right) = (self.left[row] as usize, self.right[row] as usize);
            if left >= right {
                continue;
            }
            let blocks = left / LANES..(right - 1) / LANES + 1;
            let [_, drawn] = &self.drawn;
            let (first, end) = (blocks.start.max(drawn.start), blocks.end.min(drawn.end));
            if first >= end {
                continue;
            }
            let u = (blocks.start * LANES) as f64 + 0.5;
            let start = plane[0] * u + plane[1] * (row as f64 + 0.5) + plane[2];
            let span = Span {
                left: (left - blocks.start * LANES) as u32,
                right: (right - blocks.start * LANES) as u32,
                start: start as f32,
                step,
                tag,
                first_drawn: first - blocks.start,
                last: blocks.len() - 1,
            };
            let blocks = row * blocks_per_row + first..row * blocks_per_row + end;
            span.draw(&mut self.nearness[blocks.clone()], &mut self.tags[blocks]);
        }
    }

    /// Set `left` and `right` for the rows that the polygon covers, and return these rows.
    fn scan(&mut self, corners_px: &[Vec2]) -> Range<usize> {
        let (mut top, mut bottom) = (f64::INFINITY, f64::NEG_INFINITY);
        for corner in corners_px {
            top = top.min(corner[1]);
            bottom = bottom.max(corner[1]);
        }
        let rows = self.rows_between(top, bottom);
        if rows.is_empty() {
            return 0..0;
        }
        // Rounding may leave a row of a sliver without one of its two edges: then the row is empty.
        self.left[rows.clone()].fill(self.width_px as u32);
        self.right[rows.clone()].fill(0);
        let mut from = corners_px[corners_px.len() - 1];
        for &to in corners_px {
            // Clockwise with v downwards, right edges run down. Both directions compute the same
            // numbers, so that two polygons agree on the edge that they share.
            if to[1] > from[1] {
                self.edge(from, to, true);
            } else if to[1] < from[1] {
                self.edge(to, from, false);
            }
            from = to;
        }
        rows
    }

    /// Return the drawn rows whose centre is between two heights.
    fn rows_between(&self, top_px: f64, bottom_px: f64) -> Range<usize> {
        let [drawn, _] = &self.drawn;
        first_centre(top_px, self.height_px).max(drawn.start)
            ..first_centre(bottom_px, self.height_px).min(drawn.end)
    }

    fn edge(&mut self, upper: Vec2, lower: Vec2, is_right: bool) {
        let rows = self.rows_between(upper[1], lower[1]);
        let columns = if is_right { &mut self.right } else { &mut self.left };
        let slope = (lower[0] - upper[0]) / (lower[1] - upper[1]);
        for row in rows {
            let u = upper[0] + (row as f64 + 0.5 - upper[1]) * slope;
            columns[row] = first_centre(u, self.width_px) as u32;
        }
    }
}

/// Return the index of the first pixel whose centre is at or after `coordinate_px`, within
/// `0..=size_px`.
fn first_centre(coordinate_px: f64, size_px: usize) -> usize {
    let shifted = (coordinate_px - 0.5).clamp(0.0, size_px as f64);
    // The ceiling is computed by hand: baseline x86-64 has no instruction for it.
    let whole = shifted as u32;
    whole as usize + usize::from(f64::from(whole) < shifted)
}

/// A run of pixels in one row; positions are counted from the first block's first pixel.
struct Span {
    left: u32,
    right: u32,
    start: f32,
    step: f32,
    tag: u32,
    /// Block that is drawn first.
    first_drawn: usize,
    /// Last block, drawn or not.
    last: usize,
}

impl Span {
    fn draw(&self, nearness: &mut [[f32; LANES]], tags: &mut [[u32; LANES]]) {
        let in_block = LANE_INDEX.map(|lane| lane * self.step);
        let block_step = LANES as f32 * self.step;
        for (block, (stored, tags)) in (self.first_drawn..).zip(nearness.iter_mut().zip(tags)) {
            let base = self.start + block as f32 * block_step;
            let candidate = in_block.map(|offset| base + offset);
            // If only some pixels of a block are covered, the others get a value that is never
            // nearer.
            let candidate = if block == 0 || block == self.last {
                self.covered((block * LANES) as u32, candidate)
            } else {
                candidate
            };
            merge(candidate, self.tag, stored, tags);
        }
    }

    fn covered(&self, first: u32, candidate: [f32; LANES]) -> [f32; LANES] {
        std::array::from_fn(|lane| {
            let position = first + lane as u32;
            let is_covered = position >= self.left && position < self.right;
            if is_covered { candidate[lane] } else { 0.0 }
        })
    }
}

/// Store the nearer of candidate and stored, lane by lane.
///
/// The code works on whole arrays with masks: compilers turn a conditional store into a branch,
/// with which the loop takes three times as long.
#[inline(always)]
fn merge(candidate: [f32; LANES], tag: u32, stored: &mut [f32; LANES], tags: &mut [u32; LANES]) {
    let (old, old_tags) = (*stored, *tags);
    let mask: [u32; LANES] =
        std::array::from_fn(|lane| u32::from(candidate[lane] > old[lane]).wrapping_neg());
    *stored = std::array::from_fn(|lane| {
        f32::from_bits(
            (candidate[lane].to_bits() & mask[lane]) | (old[lane].to_bits() & !mask[lane]),
        )
    });
    *tags = std::array::from_fn(|lane| (tag & mask[lane]) | (old_tags[lane] & !mask[lane]));
}
