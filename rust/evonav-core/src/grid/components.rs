//! Connected components of a bit grid, found by joining runs of cells.

use crate::grid::bits::{BitGrid, ones};

/// A run of cells with bit 1: `start..end` of one row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Run {
    /// Row of the run.
    pub row: u32,
    /// First column.
    pub start: u32,
    /// Column after the last.
    pub end: u32,
}

impl Run {
    /// Return the number of cells.
    pub fn len(&self) -> usize {
        (self.end - self.start) as usize
    }

    /// Return whether the run has no cell.
    pub fn is_empty(&self) -> bool {
        self.start == self.end
    }

    /// Return `[row, col]` of its cells.
    pub fn cells(&self) -> impl Iterator<Item = [usize; 2]> + use<> {
        let row = self.row as usize;
        (self.start..self.end).map(move |col| [row, col as usize])
    }
}

/// The connected components of a bit grid.
///
/// Each run is joined with the runs of the previous row that it touches (Wu, Otoo & Suzuki,
/// "Optimizing two-pass connected-component labeling", 2009), so the cost depends on the number of
/// runs and words, not on the number of cells.
#[derive(Debug, Clone, Default)]
pub struct Components {
    runs: Vec<Run>,
    /// Component of each run; components are numbered in the order of their first cell, row-major.
    labels: Vec<u32>,
    num: usize,
}

impl Components {
    /// Label the cells of `grid` whose bit is 1; neighbours share a side.
    pub fn new(grid: &BitGrid) -> Self {
        Self::joined(grid, 0)
    }

    /// Label the cells of `grid` whose bit is 1; neighbours share a side or a corner.
    pub fn with_corners(grid: &BitGrid) -> Self {
        Self::joined(grid, 1)
    }

    fn joined(grid: &BitGrid, reach: u32) -> Self {
        let mut runs: Vec<Run> = Vec::with_capacity(2 * grid.rows());
        let mut parents: Vec<u32> = Vec::with_capacity(2 * grid.rows());
        let mut above = 0..0;
        for row in 0..grid.rows() {
            let (words, first) = (grid.row(row), runs.len());
            if words.iter().fold(0, |any, word| any | word) != 0 {
                push_runs(words, row as u32, &mut runs);
            }
            parents.extend(first as u32..runs.len() as u32);
            join_rows(&runs, above, first..runs.len(), reach, &mut parents);
            above = first..runs.len();
        }
        // Roots are the first runs of their components, so labels ascend with them, and parents
        // come before their children.
        let mut labels = vec![0; runs.len()];
        let mut num = 0;
        for (index, &parent) in parents.iter().enumerate() {
            if parent as usize == index {
                labels[index] = num;
                num += 1;
            } else {
                labels[index] = labels[parent as usize];
            }
        }
        Self { runs, labels, num: num as usize }
    }

    /// Return the number of components.
    pub fn num(&self) -> usize {
        self.num
    }

    /// Run with their component, row-major.
    pub fn runs(&self) -> impl Iterator<Item = (Run, usize)> + '_ {
        self.runs.iter().zip(&self.labels).map(|(&run, &label)| (run, label as usize))
    }

    /// Return the component of a cell, `None` for a 0 cell.
    pub fn of_cell(&self, row: usize, col: usize) -> Option<usize> {
        let after =
            self.runs.partition_point(|run| (run.row as usize, run.start as usize) <= (row, col));
        let index = after.checked_sub(1)?;
        let run = self.runs[index];
        (run.row as usize == row && col < run.end as usize).then(|| self.labels[index] as usize)
    }

    /// Return the runs of each component, in the order of the components.
    pub fn by_component(&self) -> Grouped {
        let mut ends = vec![0; self.num + 1];
        self.labels.iter().for_each(|&label| ends[label as usize + 1] += 1);
        for i in 1..ends.len() {
            ends[i] += ends[i - 1];
        }
        let starts = ends.clone();
        let mut runs = self.runs.clone();
        for (run, label) in self.runs() {
            runs[ends[label] as usize] = run;
            ends[label] += 1;
        }
        Grouped { runs, starts }
    }
}

/// The runs of all components, one component after another.
#[derive(Debug, Clone)]
pub struct Grouped {
    runs: Vec<Run>,
    /// Component `i` has `runs[starts[i]..starts[i + 1]]`.
    starts: Vec<u32>,
}

impl Grouped {
    /// Return the runs of each component, row-major.
    pub fn iter(&self) -> impl Iterator<Item = &[Run]> {
        self.starts.windows(2).map(|span| &self.runs[span[0] as usize..span[1] as usize])
    }
}

/// Add the runs of a row, which begin and end where a bit differs from the one before it.
fn push_runs(words: &[u64], row: u32, runs: &mut Vec<Run>) {
    let (mut before, mut open) = (0, None);
    for (index, &word) in words.iter().enumerate() {
        for bit in ones(word ^ (word << 1 | before)) {
            let col = (index * 64 + bit) as u32;
            match open.take() {
                None => open = Some(col),
                Some(start) => runs.push(Run { row, start, end: col }),
            }
        }
        before = word >> 63;
    }
    if let Some(start) = open {
        runs.push(Run { row, start, end: words.len() as u32 * 64 });
    }
}

/// Join the runs of two neighbouring rows that share a column, or are at most `reach` columns
/// apart (0 or 1).
fn join_rows(
    runs: &[Run],
    mut above: std::ops::Range<usize>,
    mut here: std::ops::Range<usize>,
    reach: u32,
    parents: &mut [u32],
) {
    while !above.is_empty() && !here.is_empty() {
        let (a, b) = (runs[above.start], runs[here.start]);
        if a.start < b.end + reach && b.start < a.end + reach {
            // Most runs meet the first time, or have the same parent.
            if parents[above.start] != parents[here.start] {
                let (a, b) = (find(parents, above.start as u32), find(parents, here.start as u32));
                parents[a.max(b) as usize] = a.min(b);
            }
        }
        let is_above_first = usize::from(a.end <= b.end);
        above.start += is_above_first;
        here.start += 1 - is_above_first;
    }
}

/// Return the representative of a member of disjoint sets, and shorten the path to it.
pub(crate) fn find(parents: &mut [u32], mut index: u32) -> u32 {
    while parents[index as usize] != index {
        let grandparent = parents[parents[index as usize] as usize];
        parents[index as usize] = grandparent;
        index = grandparent;
    }
    index
}
