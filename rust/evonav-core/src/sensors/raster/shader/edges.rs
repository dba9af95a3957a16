//! Smooth edges: staircases between faces are blended as if straight lines ran through them.
//!
//! Reshetov, "Morphological Antialiasing", High Performance Graphics 2009, on faces instead of
//! colours: patterns within a face stay as they are.

use std::ops::Range;

use crate::sensors::raster::{
    canvas::{Canvas, LANES},
    shader::runs::{Runs, spans},
};

/// Change of one pixel's colour.
type Change = (u32, [i16; 3]);

/// Working memory.
#[derive(Debug, Clone, Default)]
pub(super) struct Edges {
    changes: Vec<Change>,
    /// The columns before which the row has a border, and those of the row above.
    columns: Vec<u32>,
    above: Vec<u32>,
    /// Row in which the border before each of these columns began.
    began: Vec<u32>,
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
    pub fn smooth(&mut self, canvas: &Canvas, runs: &Runs, rgb: &mut [u8]) {
        self.changes.clear();
        let picture = Picture {
            tags: canvas.tags.as_flattened(),
            rgb,
            right: Place { tag: 1, pixel: 1 },
            down: Place { tag: canvas.blocks_per_row() * LANES, pixel: canvas.width_px },
        };
        self.level(canvas, runs, &picture);
        self.upright(canvas, runs, &picture);
        for &(pixel, change) in &self.changes {
            let colour = &mut rgb[3 * pixel as usize..][..3];
            for (channel, change) in colour.iter_mut().zip(change) {
                *channel = (i16::from(*channel) + change).clamp(0, 255) as u8;
            }
        }
    }

    /// Find the runs of the borders between two rows.
    fn level(&mut self, canvas: &Canvas, runs: &Runs, picture: &Picture<'_>) {
        let width = canvas.width_px;
        for row in 1..canvas.height_px {
            let origin = Place { tag: 0, pixel: 0 }.plus(row - 1, picture.down);
            let (along, across) = (picture.right, picture.down);
            let border = Border { origin, along, across, length: width };
            let mut below = spans(runs.of_row(row), width).peekable();
            let (mut column, mut began) = (0, None);
            for (run, tag) in spans(runs.of_row(row - 1), width) {
                while column < run.end {
                    let Some((other, other_tag)) = below.peek() else { break };
                    match (began, tag != *other_tag) {
                        (None, true) => began = Some(column),
                        (Some(start), false) => {
                            began = None;
                            picture.run(&border, start..column, &mut self.changes);
                        }
                        _ => {}
                    }
                    column = run.end.min(other.end);
                    below.next_if(|(other, _)| other.end == column);
                }
            }
            if let Some(start) = began {
                picture.run(&border, start..width, &mut self.changes);
            }
        }
    }

    /// Find the runs of the borders between two columns.
    fn upright(&mut self, canvas: &Canvas, runs: &Runs, picture: &Picture<'_>) {
        let height = canvas.height_px;
        self.began.resize(canvas.width_px, 0);
        self.above.clear();
        let border = |column: u32| Border {
            origin: Place { tag: column as usize - 1, pixel: column as usize - 1 },
            along: picture.down,
            across: picture.right,
            length: height,
        };
        for row in 0..=height {
            // No border goes on below the last row.
            let starts = if row < height { &runs.of_row(row)[1..] } else { &[] };
            self.columns.clear();
            self.columns.extend(starts.iter().map(|run| run.start));
            let mut here = self.columns.iter().peekable();
            for &column in &self.above {
                while let Some(&new) = here.next_if(|new| **new < column) {
                    self.began[new as usize] = row as u32;
                }
                if here.next_if(|same| **same == column).is_none() {
                    let start = self.began[column as usize] as usize;
                    picture.run(&border(column), start..row, &mut self.changes);
                }
            }
            here.for_each(|&new| self.began[new as usize] = row as u32);
            std::mem::swap(&mut self.columns, &mut self.above);
        }
    }
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
