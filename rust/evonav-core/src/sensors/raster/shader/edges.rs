//! Smooth edges: staircases between faces are blended as if straight lines ran through them.
//!
//! Reshetov, "Morphological Antialiasing", High Performance Graphics 2009, on faces instead of
//! colours: patterns within a face stay as they are.

use crate::sensors::raster::canvas::{Canvas, LANES};

/// Change of one pixel's colour.
type Change = (u32, [i16; 3]);

/// Working memory.
#[derive(Debug, Clone, Default)]
pub(super) struct Edges {
    changes: Vec<Change>,
    /// Row in which the current run of each border between two columns began, plus 1; 0 for none.
    began: Vec<u32>,
}

/// Pixels on both sides of a border, as steps of the pixels' index.
#[derive(Clone, Copy)]
struct Border {
    /// Step along the border.
    along: usize,
    /// Step across the border, from its first side to its second.
    across: usize,
    /// Number of pixels along the border.
    length: usize,
}

impl Edges {
    /// Blend the colours at the borders between faces.
    pub fn smooth(&mut self, canvas: &Canvas, rgb: &mut [u8]) {
        self.changes.clear();
        let picture = Picture { canvas, rgb };
        self.level(&picture);
        self.upright(&picture);
        for &(pixel, change) in &self.changes {
            let colour = &mut rgb[3 * pixel as usize..][..3];
            for (channel, change) in colour.iter_mut().zip(change) {
                *channel = (i16::from(*channel) + change).clamp(0, 255) as u8;
            }
        }
    }

    /// Find the runs of the borders between two rows.
    fn level(&mut self, picture: &Picture<'_>) {
        let canvas = picture.canvas;
        let width = canvas.width_px;
        let border = Border { along: 1, across: width, length: width };
        for row in 1..canvas.height_px {
            let (above, below) = (picture.tags(row - 1), picture.tags(row));
            let mut began = None;
            for first in (0..width).step_by(LANES) {
                let end = (first + LANES).min(width);
                if began.is_none() && above[first..end] == below[first..end] {
                    continue;
                }
                for column in first..end {
                    let is_edge = above[column] != below[column];
                    match (began, is_edge) {
                        (None, true) => began = Some(column),
                        (Some(start), false) => {
                            began = None;
                            let origin = (row - 1) * width;
                            picture.run(border, origin, start..column, &mut self.changes);
                        }
                        _ => {}
                    }
                }
            }
            if let Some(start) = began {
                picture.run(border, (row - 1) * width, start..width, &mut self.changes);
            }
        }
    }

    /// Find the runs of the borders between two columns.
    fn upright(&mut self, picture: &Picture<'_>) {
        let canvas = picture.canvas;
        let (width, height) = (canvas.width_px, canvas.height_px);
        let border = Border { along: width, across: 1, length: height };
        self.began.clear();
        self.began.resize(width, 0);
        for row in 0..=height {
            let tags = if row < height { picture.tags(row) } else { &[] };
            for column in 1..width {
                let is_edge = row < height && tags[column - 1] != tags[column];
                let began = &mut self.began[column];
                match (*began, is_edge) {
                    (0, true) => *began = row as u32 + 1,
                    (0, false) | (_, true) => {}
                    (start, false) => {
                        *began = 0;
                        let rows = start as usize - 1..row;
                        picture.run(border, column - 1, rows, &mut self.changes);
                    }
                }
            }
        }
    }
}

struct Picture<'a> {
    canvas: &'a Canvas,
    rgb: &'a [u8],
}

impl Picture<'_> {
    fn tags(&self, row: usize) -> &[u32] {
        let blocks = self.canvas.row_blocks(row);
        &self.canvas.tags[blocks].as_flattened()[..self.canvas.width_px]
    }

    fn tag(&self, pixel: usize) -> u32 {
        let (row, column) = (pixel / self.canvas.width_px, pixel % self.canvas.width_px);
        self.canvas.tags[self.canvas.row_blocks(row).start + column / LANES][column % LANES]
    }

    /// Blend along one run of a border: pixels that differ from those on its other side.
    fn run(
        &self,
        border: Border,
        origin: usize,
        run: std::ops::Range<usize>,
        changes: &mut Vec<Change>,
    ) {
        let Border { along, across, length } = border;
        // The side to which the border bends at an end, where both sides have the same face: it
        // goes around the face that ends there.
        let bend = |inside: usize, outside: Option<usize>| -> i32 {
            let Some(outside) = outside else { return 0 };
            let beyond = self.tag(origin + outside * along);
            let inside = origin + inside * along;
            i32::from(beyond == self.tag(inside)) - i32::from(beyond == self.tag(inside + across))
        };
        let left = bend(run.start, run.start.checked_sub(1));
        let right = bend(run.end - 1, (run.end < length).then_some(run.end));
        let (start, end) = (run.start as f32, run.end as f32);
        let middle = match (left, right) {
            (0, 0) => return,
            (0, _) => start,
            (_, 0) => end,
            _ => 0.5 * (start + end),
        };
        for (side, from, to) in [(left, middle, start), (right, middle, end)] {
            if side == 0 {
                continue;
            }
            let (low, high) = (from.min(to), from.max(to));
            for place in low as usize..high.ceil() as usize {
                let (a, b) = (low.max(place as f32), high.min(place as f32 + 1.0));
                let share = 0.5 * (0.5 * (a + b) - from).abs() / (high - low) * (b - a);
                let first = origin + place * along;
                // A border that bends to the second side lets the first side's face in there.
                let (pixel, other) =
                    if side > 0 { (first + across, first) } else { (first, first + across) };
                changes.push((pixel as u32, self.blend(pixel, other, share)));
            }
        }
    }

    fn blend(&self, pixel: usize, other: usize, share: f32) -> [i16; 3] {
        std::array::from_fn(|i| {
            let change = f32::from(self.rgb[3 * other + i]) - f32::from(self.rgb[3 * pixel + i]);
            (change * share) as i16
        })
    }
}
