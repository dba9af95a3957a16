//! The inner loops of the rasteriser: draw convex polygons into a depth buffer.

use std::ops::Range;

use evonav_simd::Kernel;

use crate::geometry::{Vec2, Vec3};

/// Number of pixels that one step of the inner loops handles, in plain arrays, which compilers turn
/// into SIMD.
pub(super) const LANES: usize = 8;
const LANE_INDEX: [f32; LANES] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];

/// Return whether all tags of a block are one, without a branch a lane.
#[inline(always)]
pub(super) fn shows_only(tags: &[u32; LANES], tag: u32) -> bool {
    tags.iter().fold(0, |different, other| different | (other ^ tag)) == 0
}

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
    /// First row and block that are stored, and the number of blocks of a row that are.
    first_stored: [usize; 2],
    blocks_stored: usize,
    /// First pixel of the current polygon in each row; `right` has the one after its last.
    left: Vec<u32>,
    right: Vec<u32>,
}

impl Canvas {
    /// Clear the canvas; without tags it has those of earlier pictures, or none. Surfaces that are not
    /// nearer than `empty` will not be drawn.
    pub fn clear(&mut self, width_px: usize, height_px: usize, empty: f32, has_tags: bool) {
        let blocks = 0..width_px.div_ceil(LANES);
        self.clear_window([width_px, height_px], empty, 0..height_px, blocks);
        if has_tags {
            self.tags.clear();
            self.tags.resize(self.nearness.len(), [0; LANES]);
        }
    }

    /// Clear some rows and blocks without tags, and store and draw only these until the canvas is
    /// cleared again: `nearness` holds nothing else. Their pixels get the same values as when the
    /// whole canvas is drawn.
    pub fn clear_window(
        &mut self,
        size_px: [usize; 2],
        empty: f32,
        rows: Range<usize>,
        blocks: Range<usize>,
    ) {
        let num_blocks = self.store(size_px, &rows, &blocks);
        self.nearness.clear();
        self.nearness.resize(num_blocks, [empty; LANES]);
        self.draw_within(rows, blocks);
    }

    /// Store some rows and blocks of a canvas of this size; return how many blocks these are.
    fn store(
        &mut self,
        [width_px, height_px]: [usize; 2],
        rows: &Range<usize>,
        blocks: &Range<usize>,
    ) -> usize {
        (self.width_px, self.height_px) = (width_px, height_px);
        (self.first_stored, self.blocks_stored) = ([rows.start, blocks.start], blocks.len());
        self.left.resize(height_px, 0);
        self.right.resize(height_px, 0);
        rows.len() * blocks.len()
    }

    /// Clear some rows and blocks, and draw only on them until the canvas is cleared again. Their
    /// pixels get the same values as when the whole canvas is drawn.
    pub fn clear_within(
        &mut self,
        size_px @ [width_px, height_px]: [usize; 2],
        empty: f32,
        rows: Range<usize>,
        blocks: Range<usize>,
    ) {
        let num_blocks = self.store(size_px, &(0..height_px), &(0..width_px.div_ceil(LANES)));
        self.nearness.resize(num_blocks, [empty; LANES]);
        self.tags.resize(num_blocks, [0; LANES]);
        for row in rows.clone() {
            let first = self.row_blocks(row).start;
            self.nearness[first + blocks.start..first + blocks.end].fill([empty; LANES]);
            self.tags[first + blocks.start..first + blocks.end].fill([0; LANES]);
        }
        self.draw_within(rows, blocks);
    }

    /// Draw only on some rows and blocks until the canvas is cleared.
    pub fn draw_within(&mut self, rows: Range<usize>, blocks: Range<usize>) {
        self.drawn = [rows, blocks];
    }

    /// Return the rows, and the blocks of a row, on which is drawn.
    pub fn drawn(&self) -> &[Range<usize>; 2] {
        &self.drawn
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

    /// Draw a convex polygon as [`Self::fill_polygon`], without tags.
    pub fn fill(&mut self, corners_px: &[Vec2], plane: Vec3) {
        evonav_simd::compute(Fill { canvas: self, corners_px, plane });
    }

    /// Draw a convex polygon, clockwise on the screen, where it is nearer than the pixels drawn so
    /// far. `plane` gives the nearness, which is positive, at `[u, v]`: `plane . [u, v, 1]`.
    ///
    /// A pixel is covered if its centre is inside. A centre on an edge belongs to the polygon to
    /// the right of or below that edge, so that neighbours neither overlap nor leave a gap.
    #[inline(always)]
    pub fn fill_polygon<const HAS_TAGS: bool>(
        &mut self,
        corners_px: &[Vec2],
        plane: Vec3,
        tag: u32,
    ) {
        let rows = self.scan(corners_px);
        let ([first_row, first_block], stride) = (self.first_stored, self.blocks_stored);
        let [_, drawn] = self.drawn.clone();
        let step = plane[0] as f32;
        for row in rows {
            let (left, right) = (self.left[row] as usize, self.right[row] as usize);
            if left >= right {
                continue;
            }
            let blocks = left / LANES..(right - 1) / LANES + 1;
            let (first, end) = (blocks.start.max(drawn.start), blocks.end.min(drawn.end));
            if first >= end {
                continue;
            }
            let u = f64::from((blocks.start * LANES) as i32) + 0.5;
            let start = plane[0] * u + plane[1] * (f64::from(row as i32) + 0.5) + plane[2];
            let span = Span {
                left: left % LANES,
                right: (right - 1) % LANES + 1,
                start: start as f32,
                step,
                tag,
                first_drawn: (first - blocks.start) as i32,
                last: blocks.len() as i32 - 1,
            };
            let stored = (row - first_row) * stride;
            let pixels = stored + first - first_block..stored + end - first_block;
            let nearness = &mut self.nearness[pixels.clone()];
            span.draw(nearness, if HAS_TAGS { Some(&mut self.tags[pixels]) } else { None });
        }
    }

    /// Set `left` and `right` for the rows that the polygon covers, and return these rows.
    #[inline(always)]
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
    #[inline(always)]
    fn rows_between(&self, top_px: f64, bottom_px: f64) -> Range<usize> {
        let [drawn, _] = &self.drawn;
        let first = |at_px: f64| first_centre(at_px, self.height_px as f64) as usize;
        first(top_px).max(drawn.start)..first(bottom_px).min(drawn.end)
    }

    #[inline(always)]
    fn edge(&mut self, upper: Vec2, lower: Vec2, is_right: bool) {
        let rows = self.rows_between(upper[1], lower[1]);
        let columns = if is_right { &mut self.right } else { &mut self.left };
        // If the part of the image on which is drawn has none of them, the rows may run backwards.
        let Some(columns) = columns.get_mut(rows.clone()) else { return };
        let slope = (lower[0] - upper[0]) / (lower[1] - upper[1]);
        let width = self.width_px as f64;
        for (row, column) in (rows.start as i32..).zip(columns) {
            let u = upper[0] + (f64::from(row) + 0.5 - upper[1]) * slope;
            *column = first_centre(u, width);
        }
    }
}

/// [`Canvas::fill`] and its arguments.
struct Fill<'a> {
    canvas: &'a mut Canvas,
    corners_px: &'a [Vec2],
    plane: Vec3,
}

impl Kernel for Fill<'_> {
    type Output = ();

    #[inline(always)]
    fn compute(self) {
        self.canvas.fill_polygon::<false>(self.corners_px, self.plane, 0);
    }
}

/// Return the index of the first pixel whose centre is at or after `coordinate_px`, within
/// `0..=size_px`.
#[inline(always)]
fn first_centre(coordinate_px: f64, size_px: f64) -> u32 {
    // The ceiling is computed by hand, since baseline x86-64 has no instruction for it: the whole
    // number nearest to a number by the mantissa of a sum with 2^52.
    const WHOLE: f64 = 4_503_599_627_370_496.0;
    let shifted = coordinate_px - 0.5;
    let shifted = if shifted > 0.0 { shifted } else { 0.0 };
    let shifted = if shifted < size_px { shifted } else { size_px };
    let sum = shifted + WHOLE;
    sum.to_bits() as u32 + u32::from(sum - WHOLE < shifted)
}

/// A block of lanes that are covered, between two of lanes that are not.
const COVERED: [u32; 3 * LANES] = {
    let mut lanes = [0; 3 * LANES];
    let mut lane = LANES;
    while lane < 2 * LANES {
        lanes[lane] = u32::MAX;
        lane += 1;
    }
    lanes
};

/// A run of pixels in one row.
struct Span {
    /// First covered lane of the first block, and the one after the last block's last.
    left: usize,
    right: usize,
    /// Nearness at the first block's first lane, and its change from lane to lane.
    start: f32,
    step: f32,
    tag: u32,
    /// Block that is drawn first.
    first_drawn: i32,
    /// Last block, drawn or not.
    last: i32,
}

impl Span {
    /// Draw the span.
    ///
    /// # Arguments
    /// * `tags` - `None` to leave them as they are.
    #[inline(always)]
    fn draw(&self, nearness: &mut [[f32; LANES]], tags: Option<&mut [[u32; LANES]]>) {
        let blocks = (self.first_drawn..).zip(nearness.iter_mut());
        let Some(tags) = tags else {
            for (block, stored) in blocks {
                let candidate = self.candidate(block).map(bits);
                for (stored, new) in stored.iter_mut().zip(candidate) {
                    *stored = larger(new, bits(*stored));
                }
            }
            return;
        };
        for ((block, stored), tags) in blocks.zip(tags) {
            merge(self.candidate(block), self.tag, stored, tags);
        }
    }

    /// Return the nearness of a block. If only some of its pixels are covered, the others get a
    /// value that is never nearer.
    #[inline(always)]
    fn candidate(&self, block: i32) -> [f32; LANES] {
        let base = self.start + block as f32 * (LANES as f32 * self.step);
        let mut candidate = LANE_INDEX.map(|lane| base + lane * self.step);
        if block == 0 {
            candidate = masked(candidate, &COVERED[LANES - self.left..]);
        }
        if block == self.last {
            candidate = masked(candidate, &COVERED[2 * LANES - self.right..]);
        }
        candidate
    }
}

/// Return the numbers of some lanes, and 0 in the others.
#[inline(always)]
fn masked(numbers: [f32; LANES], mask: &[u32]) -> [f32; LANES] {
    let mask: &[u32; LANES] = mask.first_chunk().expect("two blocks of lanes");
    std::array::from_fn(|lane| f32::from_bits(numbers[lane].to_bits() & mask[lane]))
}

/// Return a number's bits. Those of numbers that are not negative are in the order of the numbers,
/// and those of negative ones are less.
#[inline(always)]
fn bits(number: f32) -> i32 {
    number.to_bits().cast_signed()
}

/// Return the number with the larger [`bits`].
#[inline(always)]
fn larger(a: i32, b: i32) -> f32 {
    f32::from_bits(a.max(b).cast_unsigned())
}

/// Store the nearer of candidate and stored, lane by lane.
///
/// The larger integer is stored, and only after the old tags were read: compilers turn a choice
/// between a number and the one in its place into a store under a mask, with which a whole image
/// takes 1.6 times as long on processors of AMD, and a conditional store into a branch, with which
/// the loop takes three times as long.
#[inline(always)]
fn merge(candidate: [f32; LANES], tag: u32, stored: &mut [f32; LANES], tags: &mut [u32; LANES]) {
    let (new, old, old_tags) = (candidate.map(bits), stored.map(bits), *tags);
    let mask: [u32; LANES] =
        std::array::from_fn(|lane| u32::from(new[lane] > old[lane]).wrapping_neg());
    *stored = std::array::from_fn(|lane| larger(new[lane], old[lane]));
    *tags = std::array::from_fn(|lane| (tag & mask[lane]) | (old_tags[lane] & !mask[lane]));
}
