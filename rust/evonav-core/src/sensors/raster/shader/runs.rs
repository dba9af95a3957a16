//! The rows of a picture as runs of pixels of one face.

use std::ops::Range;

use crate::sensors::raster::canvas::{Canvas, LANES, shows_only};

/// Pixels of a row with the same tag, up to the start of the next run.
#[derive(Debug, Clone, Copy)]
pub(super) struct Run {
    pub start: u32,
    pub tag: u32,
}

/// The runs of all rows.
#[derive(Debug, Clone, Default)]
pub(super) struct Runs {
    runs: Vec<Run>,
    /// Index of each row's first run, and the number of runs.
    rows: Vec<usize>,
}

impl Runs {
    #[inline(always)]
    pub fn find(&mut self, canvas: &Canvas) {
        self.runs.clear();
        self.rows.clear();
        for row in 0..canvas.height_px {
            self.rows.push(self.runs.len());
            let tags = &canvas.tags[canvas.row_blocks(row)].as_flattened()[..canvas.width_px];
            let mut start = 0;
            while start < tags.len() {
                self.runs.push(Run { start: start as u32, tag: tags[start] });
                start += run_length(&tags[start..]);
            }
        }
        self.rows.push(self.runs.len());
    }

    /// Return the runs of a row.
    pub fn of_row(&self, row: usize) -> &[Run] {
        &self.runs[self.rows[row]..self.rows[row + 1]]
    }
}

/// Return the pixels and tags of a row's runs.
pub(super) fn spans(runs: &[Run], width_px: usize) -> impl Iterator<Item = (Range<usize>, u32)> {
    let ends = runs[1..].iter().map(|run| run.start as usize).chain([width_px]);
    runs.iter().zip(ends).map(|(run, end)| (run.start as usize..end, run.tag))
}

/// Return the number of equal tags at the start.
#[inline(always)]
fn run_length(tags: &[u32]) -> usize {
    let (blocks, _) = tags.as_chunks::<LANES>();
    let whole = blocks.iter().take_while(|block| shows_only(block, tags[0])).count() * LANES;
    whole + tags[whole..].iter().take_while(|&&tag| tag == tags[0]).count()
}
