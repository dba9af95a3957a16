//! Connected components of a bit grid, found by joining runs of cells.

use crate::grid::bits::BitGrid;

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

/// The 4-connected components of a bit grid.
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
    /// Label the cells of `grid` whose bit is 1.
    pub fn new(grid: &BitGrid) -> Self {
        let mut runs: Vec<Run> = Vec::new();
        let mut parents: Vec<u32> = Vec::new();
        let mut above = 0..0;
        for row in 0..grid.rows() {
            let first = runs.len();
            push_runs(grid.row(row), row as u32, &mut runs);
            parents.extend(first as u32..runs.len() as u32);
            join_rows(&runs, above, first..runs.len(), &mut parents);
            above = first..runs.len();
        }
        // Roots are the first runs of their components, so labels ascend with them.
        let mut labels = vec![0; runs.len()];
        let mut num = 0;
        for index in 0..runs.len() {
            let root = find(&mut parents, index as u32) as usize;
            if root == index {
                labels[index] = num;
                num += 1;
            } else {
                labels[index] = labels[root];
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
    pub fn by_component(&self) -> Vec<Vec<Run>> {
        let mut lists = vec![Vec::new(); self.num];
        for (run, label) in self.runs() {
            lists[label].push(run);
        }
        lists
    }
}

/// Take 8-connected groups of cells out of a grid, in the order of their first cells; the cells of a
/// group are in no particular order.
pub fn take_groups(mut cells: BitGrid) -> Vec<Vec<[usize; 2]>> {
    let mut groups = Vec::new();
    let all: Vec<[usize; 2]> = cells.cells().collect();
    for first in all {
        if !cells.get(first[0], first[1]) {
            continue;
        }
        cells.remove(first[0], first[1]);
        let mut group = vec![first];
        let mut next = 0;
        while let Some(&[row, col]) = group.get(next) {
            next += 1;
            for r in row.saturating_sub(1)..=row + 1 {
                for c in col.saturating_sub(1)..=col + 1 {
                    if cells.get(r, c) {
                        cells.remove(r, c);
                        group.push([r, c]);
                    }
                }
            }
        }
        groups.push(group);
    }
    groups
}

fn push_runs(words: &[u64], row: u32, runs: &mut Vec<Run>) {
    let mut open: Option<u32> = None;
    for (index, &word) in words.iter().enumerate() {
        let base = index as u32 * 64;
        let mut bit = 0;
        while bit < 64 {
            // Length of the stretch of equal bits that starts here.
            let rest = word >> bit;
            if open.is_none() {
                let zeros = rest.trailing_zeros().min(64 - bit);
                bit += zeros;
                if bit < 64 {
                    open = Some(base + bit);
                }
            } else {
                let ones = (!rest).trailing_zeros().min(64 - bit);
                bit += ones;
                if bit < 64
                    && let Some(start) = open.take()
                {
                    runs.push(Run { row, start, end: base + bit });
                }
            }
        }
    }
    if let Some(start) = open {
        runs.push(Run { row, start, end: words.len() as u32 * 64 });
    }
}

/// Join the runs of two neighbouring rows that share a column.
fn join_rows(
    runs: &[Run],
    mut above: std::ops::Range<usize>,
    mut here: std::ops::Range<usize>,
    parents: &mut [u32],
) {
    while !above.is_empty() && !here.is_empty() {
        let (a, b) = (runs[above.start], runs[here.start]);
        if a.start < b.end && b.start < a.end {
            let (a, b) = (find(parents, above.start as u32), find(parents, here.start as u32));
            parents[a.max(b) as usize] = a.min(b);
        }
        if a.end <= b.end {
            above.start += 1;
        } else {
            here.start += 1;
        }
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
