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
        let Self { drawn: [_, drawn], left, right, nearness, tags, .. } = self;
        let drawn_px = [drawn.start, drawn.end].map(|block| (block * LANES) as u32);
        let step = plane[0] as f32;
        let ends = left[rows.clone()].iter().zip(&right[rows.clone()]);
        for (row, (&left, &right)) in rows.zip(ends) {
            let origin = (left as usize / LANES) as i32;
            let (left, right) = (left.max(drawn_px[0]) as usize, right.min(drawn_px[1]) as usize);
            if left >= right {
                continue;
            }
            let (first, end) = (left / LANES, (right - 1) / LANES + 1);
            let u = f64::from(origin * LANES as i32) + 0.5;
            let start = plane[0] * u + plane[1] * (f64::from(row as i32) + 0.5) + plane[2];
            let span = Span {
                left: left % LANES,
                right: (right - 1) % LANES + 1,
                start: start as f32,
                step,
                first: first as i32 - origin,
                tag,
            };
            let stored = (row - first_row) * stride;
            let pixels = stored + first - first_block..stored + end - first_block;
            let nearness = &mut nearness[pixels.clone()];
            span.draw(nearness, if HAS_TAGS { Some(&mut tags[pixels]) } else { None });
        }
    }

    /// Set `left` and `right` for the rows that the polygon covers, and return these rows.
    ///
    /// Corners are taken to the row whose centre is next. An outline that is closed passes each row
    /// between its highest and its lowest corner downwards and upwards, whatever their rounding.
    #[inline(always)]
    fn scan(&mut self, corners_px: &[Vec2]) -> Range<usize> {
        let (height, [drawn, _]) = (self.height_px as f64, self.drawn.clone());
        let row_of = |corner: Vec2| {
            (first_centre(corner[1], height) as usize).max(drawn.start).min(drawn.end)
        };
        let (mut top, mut bottom) = (drawn.end, drawn.start);
        let mut from = corners_px[corners_px.len() - 1];
        let mut from_row = row_of(from);
        for &to in corners_px {
            let to_row = row_of(to);
            (top, bottom) = (top.min(to_row), bottom.max(to_row));
            // Clockwise with v downwards, right edges run down. Both directions compute the same
            // numbers, so that two polygons agree on the edge that they share.
            if to_row > from_row {
                self.edge(from, to, from_row..to_row, true);
            } else if to_row < from_row {
                self.edge(to, from, to_row..from_row, false);
            }
            (from, from_row) = (to, to_row);
        }
        top..bottom
    }

    /// Set where an edge passes rows.
    #[inline(always)]
    fn edge(&mut self, upper: Vec2, lower: Vec2, rows: Range<usize>, is_right: bool) {
        let slope = (lower[0] - upper[0]) / (lower[1] - upper[1]);
        let width = self.width_px as f64;
        let columns = if is_right { &mut self.right } else { &mut self.left };
        for (row, column) in (rows.start as i32..).zip(&mut columns[rows]) {
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
    /// Nearness at the first lane of block 0, and its change from lane to lane and block to block.
    start: f32,
    step: f32,
    /// Number of the first block.
    first: i32,
    tag: u32,
}

impl Span {
    /// Draw the span.
    ///
    /// # Arguments
    /// * `nearness` - the span's blocks, one or more.
    /// * `tags` - theirs; `None` to leave them as they are.
    #[inline(always)]
    fn draw(&self, nearness: &mut [[f32; LANES]], tags: Option<&mut [[u32; LANES]]>) {
        let Some(tags) = tags else {
            return self.each_block(nearness.iter_mut(), |candidate, stored| {
                *stored = std::array::from_fn(|i| larger(bits(candidate[i]), bits(stored[i])));
            });
        };
        self.each_block(nearness.iter_mut().zip(tags), |candidate, (stored, tags)| {
            merge(candidate, self.tag, stored, tags);
        });
    }

    /// Pass on the nearness of each block. Pixels of the first and the last that are not covered
    /// get a value that is never nearer.
    #[inline(always)]
    fn each_block<B>(
        &self,
        mut blocks: impl DoubleEndedIterator<Item = B> + ExactSizeIterator,
        mut pass: impl FnMut([f32; LANES], B),
    ) {
        let (left, right) = (&COVERED[LANES - self.left..], &COVERED[2 * LANES - self.right..]);
        let (mut number, last) = (self.first as f32, self.first + blocks.len() as i32 - 1);
        let (Some(first_block), last_block) = (blocks.next(), blocks.next_back()) else { return };
        let first = masked(self.candidate(number), left);
        let Some(last_block) = last_block else { return pass(masked(first, right), first_block) };
        pass(first, first_block);
        for block in blocks {
            // Counted in floating point, compilers do not compute many blocks a step.
            number += 1.0;
            pass(self.candidate(number), block);
        }
        pass(masked(self.candidate(last as f32), right), last_block);
    }

    /// Return the nearness of a block.
    #[inline(always)]
    fn candidate(&self, block: f32) -> [f32; LANES] {
        let base = self.start + block * (LANES as f32 * self.step);
        LANE_INDEX.map(|lane| base + lane * self.step)
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
/// The larger integer is stored: compilers turn a choice between a number and the one in its place
/// into a store under a mask, with which a whole image takes 1.6 times as long on processors of AMD,
/// and a conditional store into a branch, with which the loop takes three times as long. Nor do they
/// see a choice of tags in a shift by 30. The clip planes of views keep all nearness of a canvas
/// within a factor of 2^128, and its bits within 2^30, so that the result is 0 or -1.
#[inline(always)]
fn merge(candidate: [f32; LANES], tag: u32, stored: &mut [f32; LANES], tags: &mut [u32; LANES]) {
    let (new, old, old_tags) = (candidate.map(bits), stored.map(bits), *tags);
    let nearer: [i32; LANES] = std::array::from_fn(|lane| new[lane].max(old[lane]));
    let mask: [u32; LANES] =
        std::array::from_fn(|lane| (old[lane].wrapping_sub(nearer[lane]) >> 30).cast_unsigned());
    *stored = nearer.map(|bits| f32::from_bits(bits.cast_unsigned()));
    *tags = std::array::from_fn(|lane| (tag & mask[lane]) | (old_tags[lane] & !mask[lane]));
}

#[cfg(test)]
mod tests {
    use proptest::{collection::vec, prelude::*};

    use super::Canvas;

    proptest! {
        /// No row of an outline, be it a sliver or none that a part has, shows an earlier polygon's ends.
        #[test]
        fn polygons_do_not_depend_on_the_polygon_before(
            corners_px in vec(([-4..24_i32, -4..24_i32], [-1e-9..1e-9_f64, -1e-9..1e-9]), 3..7),
            ends in [0..30_u32, 0..30_u32],
            rows in 0..10_usize,
            blocks in 0..2_usize,
        ) {
            let at = |(at, by): &([i32; 2], [f64; 2])| [0, 1].map(|i| 0.5 * f64::from(at[i]) + by[i]);
            let corners_px: Vec<_> = corners_px.iter().map(at).collect();
            let drawn = |[left, right]: [u32; 2]| {
                let mut canvas = Canvas::default();
                canvas.clear(19, 12, 0.5, true);
                canvas.draw_within(rows..rows + 2, blocks..blocks + 2);
                (canvas.left, canvas.right) = (vec![left; 12], vec![right; 12]);
                canvas.fill_polygon::<true>(&corners_px, [0.01, -0.01, 1.0], 7);
                (canvas.nearness, canvas.tags)
            };
            prop_assert_eq!(drawn([19, 0]), drawn(ends));
        }
    }
}
