//! Smooth edges: staircases between faces are blended as if straight lines ran through them.
//!
//! Reshetov, "Morphological Antialiasing", High Performance Graphics 2009, on faces instead of
//! colours: patterns within a face stay as they are.

use std::ops::Range;

use crate::sensors::raster::canvas::{Canvas, LANES};

/// Change of one pixel's colour.
type Change = (u32, [i16; 3]);

/// Working memory.
#[derive(Debug, Clone, Default)]
pub(super) struct Edges {
    changes: Vec<Change>,
    /// Row in which the current run of each border between two columns began, plus 1; 0 for none.
    began: Vec<[u32; LANES]>,
}

/// Steps of the indices of tags, whose rows are padded, and of pixels.
#[derive(Clone, Copy)]
struct Place {
    tag: usize,
    pixel: usize,
}

impl Place {
    fn plus(self, num: usize, step: Self) -> Self {
        Self { tag: self.tag + num * step.tag, pixel: self.pixel + num * step.pixel }
    }
}

/// A border between two rows or columns.
#[derive(Clone, Copy)]
struct Border {
    /// The first pixel on its first side.
    origin: Place,
    /// Step along the border.
    along: Place,
    /// Step across the border, from its first side to its second.
    across: Place,
    /// Number of pixels along the border.
    length: usize,
}

impl Edges {
    /// Blend the colours at the borders between faces.
    pub fn smooth(&mut self, canvas: &Canvas, rgb: &mut [u8]) {
        self.changes.clear();
        let picture = Picture {
            tags: canvas.tags.as_flattened(),
            rgb,
            right: Place { tag: 1, pixel: 1 },
            down: Place { tag: canvas.blocks_per_row() * LANES, pixel: canvas.width_px },
        };
        self.level(canvas, &picture);
        self.upright(canvas, &picture);
        for &(pixel, change) in &self.changes {
            let colour = &mut rgb[3 * pixel as usize..][..3];
            for (channel, change) in colour.iter_mut().zip(change) {
                *channel = (i16::from(*channel) + change).clamp(0, 255) as u8;
            }
        }
    }

    /// Find the runs of the borders between two rows.
    fn level(&mut self, canvas: &Canvas, picture: &Picture<'_>) {
        let width = canvas.width_px;
        for row in 1..canvas.height_px {
            let (first, second) = (canvas.row_blocks(row - 1), canvas.row_blocks(row));
            let blocks = canvas.tags[first].iter().zip(&canvas.tags[second]);
            let origin = Place { tag: 0, pixel: 0 }.plus(row - 1, picture.down);
            let (along, across) = (picture.right, picture.down);
            let border = Border { origin, along, across, length: width };
            let mut began = None;
            for (block, (above, below)) in blocks.enumerate() {
                if began.is_none() && is_same(above, below) {
                    continue;
                }
                for lane in 0..LANES.min(width - block * LANES) {
                    let column = block * LANES + lane;
                    match (began, above[lane] != below[lane]) {
                        (None, true) => began = Some(column),
                        (Some(start), false) => {
                            began = None;
                            picture.run(&border, start..column, &mut self.changes);
                        }
                        _ => {}
                    }
                }
            }
            if let Some(start) = began {
                picture.run(&border, start..width, &mut self.changes);
            }
        }
    }

    /// Find the runs of the borders between two columns.
    fn upright(&mut self, canvas: &Canvas, picture: &Picture<'_>) {
        let (width, height) = (canvas.width_px, canvas.height_px);
        self.began.clear();
        self.began.resize(canvas.blocks_per_row(), [0; LANES]);
        let border = |column: usize| Border {
            origin: Place { tag: column - 1, pixel: column - 1 },
            along: picture.down,
            across: picture.right,
            length: height,
        };
        for row in 0..height {
            let mut before = canvas.tags[canvas.row_blocks(row).start][0];
            let blocks = canvas.tags[canvas.row_blocks(row)].iter().zip(&mut self.began);
            for (block, (tags, began)) in blocks.enumerate() {
                let mut shifted = [before; LANES];
                shifted[1..].copy_from_slice(&tags[..LANES - 1]);
                before = tags[LANES - 1];
                if is_same(tags, &shifted) && *began == [0; LANES] {
                    continue;
                }
                for lane in 0..LANES.min(width - block * LANES) {
                    match (began[lane], tags[lane] != shifted[lane]) {
                        (0, true) => began[lane] = row as u32 + 1,
                        (0, false) | (_, true) => {}
                        (start, false) => {
                            began[lane] = 0;
                            let border = border(block * LANES + lane);
                            picture.run(&border, start as usize - 1..row, &mut self.changes);
                        }
                    }
                }
            }
        }
        for (column, &start) in self.began.as_flattened().iter().enumerate() {
            if start > 0 {
                picture.run(&border(column), start as usize - 1..height, &mut self.changes);
            }
        }
    }
}

/// Compare blocks without a branch a lane.
fn is_same(a: &[u32; LANES], b: &[u32; LANES]) -> bool {
    (0..LANES).fold(0, |different, lane| different | (a[lane] ^ b[lane])) == 0
}

struct Picture<'a> {
    tags: &'a [u32],
    rgb: &'a [u8],
    right: Place,
    down: Place,
}

impl Picture<'_> {
    /// Blend along one run of a border: pixels that differ from those on its other side.
    fn run(&self, border: &Border, run: Range<usize>, changes: &mut Vec<Change>) {
        let Border { origin, along, across, length } = *border;
        // The side to which the border bends at an end, where both sides have the same face: it
        // goes around the face that ends there.
        let bend = |inside: usize, outside: usize| -> i32 {
            let beyond = self.tags[origin.plus(outside, along).tag];
            let here = origin.plus(inside, along);
            i32::from(beyond == self.tags[here.tag])
                - i32::from(beyond == self.tags[here.plus(1, across).tag])
        };
        let left = if run.start > 0 { bend(run.start, run.start - 1) } else { 0 };
        let right = if run.end < length { bend(run.end - 1, run.end) } else { 0 };
        let (start, end) = (run.start as f32, run.end as f32);
        let middle = match (left, right) {
            (0, 0) => return,
            (0, _) => start,
            (_, 0) => end,
            _ => 0.5 * (start + end),
        };
        for (side, tip) in [(left, start), (right, end)] {
            if side == 0 {
                continue;
            }
            let (low, high) = (middle.min(tip), middle.max(tip));
            let slope = 0.5 / (high - low);
            for place in low as usize..(high + 0.5) as usize {
                let (a, b) = (low.max(place as f32), high.min(place as f32 + 1.0));
                let share = slope * (0.5 * (a + b) - middle).abs() * (b - a);
                let first = origin.plus(place, along).pixel;
                let second = first + across.pixel;
                // A border that bends to the second side lets the first side's face in there.
                let (pixel, other) = if side > 0 { (second, first) } else { (first, second) };
                changes.push((pixel as u32, self.blend(pixel, other, share)));
            }
        }
    }

    fn blend(&self, pixel: usize, other: usize, share: f32) -> [i16; 3] {
        let [own, other] = [pixel, other].map(|pixel| &self.rgb[3 * pixel..][..3]);
        std::array::from_fn(|i| ((f32::from(other[i]) - f32::from(own[i])) * share) as i16)
    }
}
