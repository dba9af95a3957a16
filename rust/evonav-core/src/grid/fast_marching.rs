//! Compute distances around obstacles by fast marching.

use std::{cmp::Reverse, collections::BinaryHeap};

use crate::grid::bits::{BitGrid, beside};

/// A rectangle of cells of a larger grid.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Window {
    /// First cell, `[row, col]`.
    pub first: [usize; 2],
    /// Number of rows and columns.
    pub shape: [usize; 2],
}

impl Window {
    /// Return the index of a cell in row-major storage of the window; `None` if it is outside.
    pub fn index(&self, cell: [usize; 2]) -> Option<usize> {
        let row = cell[0].checked_sub(self.first[0])?;
        let col = cell[1].checked_sub(self.first[1])?;
        (row < self.shape[0] && col < self.shape[1]).then(|| row * self.shape[1] + col)
    }
}

/// Distances from the seeds of [`march`].
#[derive(Debug, Clone, PartialEq)]
pub struct Field {
    /// Window that `distances` covers.
    pub window: Window,
    /// Distances in cells, row-major; infinite for cells that the front did not reach.
    pub distances: Vec<f32>,
    /// Last cell that the front reached.
    pub last: Option<[usize; 2]>,
}

impl Field {
    /// Return the distance of a cell in cells; infinite outside the window and for cells that the
    /// front did not reach.
    pub fn at(&self, cell: [usize; 2]) -> f32 {
        self.window.index(cell).map_or(f32::INFINITY, |index| self.distances[index])
    }
}

/// The condition on which a front stops.
#[derive(Debug, Clone, Copy)]
pub enum Until<'a> {
    /// All cells that can be reached are reached.
    Never,
    /// All of these cells are reached.
    All(&'a [[usize; 2]]),
    /// One of these cells is reached.
    Any(&'a BitGrid),
}

const WALL: u8 = 0;
const FAR: u8 = 1;
const ACCEPTED: u8 = 2;

/// Compute the distances from the nearest seed over passable cells. The eikonal equation is solved
/// by second-order upwind differences; cells are accepted in the order of their distance.
///
/// # Arguments
/// * `passable` - cells that the front may cross.
/// * `seeds` - cells at distance 0, of the same grid; they need not be passable.
/// * `window` - window in which the front stays; it is clipped to the grid.
/// * `until` - condition on which the front stops; the distances of farther cells stay infinite.
///
/// # Returns
/// Distances in cells.
///
/// # Complexity
/// O(n log n) for n cells that the front reaches.
///
/// # Source
/// Sethian, "A fast marching level set method for monotonically advancing fronts", PNAS 1996;
/// second order as in "Fast marching methods", SIAM Review 1999.
///
/// # Examples
/// ```
/// # use evonav_core::{grid::{bits::BitGrid, fast_marching::{Until, Window, march}}};
/// let mut passable = BitGrid::new(3, 9);
/// (0..3).for_each(|row| passable.insert_run(row, 0, 9));
/// let mut seeds = BitGrid::new(3, 9);
/// seeds.insert(1, 0);
/// let field = march(&passable, &seeds, Window { first: [0, 0], shape: [3, 9] }, Until::Never);
/// assert_eq!(field.at([1, 8]), 8.0);
/// ```
pub fn march(passable: &BitGrid, seeds: &BitGrid, window: Window, until: Until<'_>) -> Field {
    let first = [0, 1].map(|i| window.first[i].min([passable.rows(), passable.cols()][i]));
    let shape =
        [0, 1].map(|i| window.shape[i].min([passable.rows(), passable.cols()][i] - first[i]));
    let mut front = Front::new(passable, Window { first, shape });
    let num_ends = front.aim(until);
    front.seed(seeds);
    let mut num_reached = 0;
    let mut last = None;
    while let Some(Reverse(key)) = front.queue.pop() {
        let index = (key & u64::from(u32::MAX)) as usize;
        if front.states[index] == ACCEPTED {
            continue;
        }
        front.states[index] = ACCEPTED;
        last = Some(index);
        num_reached += usize::from(front.is_end[index]);
        if num_ends.is_some_and(|num_ends| num_reached >= num_ends) {
            break;
        }
        for step in front.steps() {
            front.update(index.wrapping_add_signed(step));
        }
    }
    let last = last.map(|index| front.cell(index));
    front.into_field(last)
}

/// Return the passable cells 4-connected with `start`, which counts as passable.
pub fn flood(passable: &BitGrid, start: [usize; 2], window: Window) -> BitGrid {
    let mut reached = BitGrid::new(passable.rows(), passable.cols());
    let mut stack = vec![start];
    reached.insert(start[0], start[1]);
    while let Some(cell) = stack.pop() {
        for [r, c] in beside(cell) {
            if window.index([r, c]).is_some() && passable.get(r, c) && !reached.get(r, c) {
                reached.insert(r, c);
                stack.push([r, c]);
            }
        }
    }
    reached
}

/// A marching front over a window with a wall two cells wide around it.
struct Front {
    window: Window,
    stride: usize,
    states: Vec<u8>,
    distances: Vec<f32>,
    is_end: Vec<bool>,
    /// Entries with the bits of the distance above the index: floats that are not negative sort
    /// like their bits.
    queue: BinaryHeap<Reverse<u64>>,
}

const PAD: usize = 2;

impl Front {
    fn new(passable: &BitGrid, window: Window) -> Self {
        let stride = window.shape[1] + 2 * PAD;
        let num = stride * (window.shape[0] + 2 * PAD);
        let mut states = vec![WALL; num];
        for row in 0..window.shape[0] {
            let start = (row + PAD) * stride + PAD;
            let cells = &mut states[start..start + window.shape[1]];
            for (col, state) in cells.iter_mut().enumerate() {
                let is_passable = passable.get(window.first[0] + row, window.first[1] + col);
                *state = if is_passable { FAR } else { WALL };
            }
        }
        Self {
            window,
            stride,
            states,
            distances: vec![f32::INFINITY; num],
            is_end: vec![false; num],
            queue: BinaryHeap::new(),
        }
    }

    fn padded(&self, cell: [usize; 2]) -> Option<usize> {
        self.window.index(cell)?;
        let [row, col] = [0, 1].map(|i| cell[i] - self.window.first[i] + PAD);
        Some(row * self.stride + col)
    }

    fn cell(&self, index: usize) -> [usize; 2] {
        let cell = [index / self.stride, index % self.stride];
        [0, 1].map(|i| cell[i] - PAD + self.window.first[i])
    }

    /// Mark the cells at which the front stops; return how many of them must be reached.
    fn aim(&mut self, until: Until<'_>) -> Option<usize> {
        let ends: Vec<usize> = match until {
            Until::Never => return None,
            Until::All(cells) => cells.iter().filter_map(|&cell| self.padded(cell)).collect(),
            Until::Any(cells) => cells.cells().filter_map(|cell| self.padded(cell)).collect(),
        };
        ends.iter().for_each(|&index| self.is_end[index] = true);
        let num_ends = self.is_end.iter().filter(|is_end| **is_end).count();
        Some(if matches!(until, Until::Any(_)) { num_ends.min(1) } else { num_ends })
    }

    fn steps(&self) -> [isize; 4] {
        let stride = self.stride as isize;
        [-stride, -1, 1, stride]
    }

    fn push(&mut self, index: usize, distance: f32) {
        self.distances[index] = distance;
        self.queue.push(Reverse(u64::from(distance.to_bits()) << 32 | index as u64));
    }

    /// Set the seeds to 0, and their diagonal neighbours to their true distance: upwind differences
    /// alone would give 1.71.
    fn seed(&mut self, seeds: &BitGrid) {
        let indices: Vec<usize> = seeds.cells().filter_map(|cell| self.padded(cell)).collect();
        for &index in &indices {
            self.states[index] = FAR;
            self.push(index, 0.0);
        }
        let stride = self.stride as isize;
        for &index in &indices {
            for (row, col) in [(-stride, -1), (-stride, 1), (stride, -1), (stride, 1)] {
                let at = |step: isize| index.wrapping_add_signed(step);
                let is_open = [row, col, row + col].iter().all(|&s| self.states[at(s)] != WALL);
                let corner = at(row + col);
                if is_open && self.distances[corner] > std::f32::consts::SQRT_2 {
                    self.push(corner, std::f32::consts::SQRT_2);
                }
            }
        }
    }

    /// Update a cell's distance from its accepted neighbours.
    fn update(&mut self, index: usize) {
        if self.states[index] != FAR {
            return;
        }
        let stride = self.stride as isize;
        let terms = [stride, 1].map(|step| self.upwind(index, step));
        let distance = solve(terms);
        if distance < self.distances[index] {
            self.push(index, distance);
        }
    }

    /// Return the upwind term along one axis: weight and offset of `weight * (d - offset)^2`, and
    /// the neighbour's distance.
    fn upwind(&self, index: usize, step: isize) -> Option<Term> {
        let side = |step: isize| {
            let near = index.wrapping_add_signed(step);
            (self.states[near] == ACCEPTED).then(|| (self.distances[near], step))
        };
        let (near, step) = match (side(-step), side(step)) {
            (Some(a), Some(b)) => Some(if b.0 < a.0 { b } else { a }),
            (a, b) => a.or(b),
        }?;
        let far = index.wrapping_add_signed(2 * step);
        let second = (self.states[far] == ACCEPTED).then(|| self.distances[far]);
        Some(match second.filter(|&second| second < near) {
            Some(second) => Term { weight: 2.25, offset: (4.0 * near - second) / 3.0, near },
            None => Term { weight: 1.0, offset: near, near },
        })
    }

    fn into_field(self, last: Option<[usize; 2]>) -> Field {
        let [rows, cols] = self.window.shape;
        let mut distances = Vec::with_capacity(rows * cols);
        for row in 0..rows {
            let start = (row + PAD) * self.stride + PAD;
            for index in start..start + cols {
                let is_accepted = self.states[index] == ACCEPTED;
                distances.push(if is_accepted { self.distances[index] } else { f32::INFINITY });
            }
        }
        Field { window: self.window, distances, last }
    }
}

#[derive(Clone, Copy)]
struct Term {
    weight: f32,
    offset: f32,
    near: f32,
}

/// Return the larger root of `sum weight * (d - offset)^2 = 1`; it is not below the neighbours from
/// which it is computed.
fn solve(terms: [Option<Term>; 2]) -> f32 {
    let alone = |term: Term| term.offset + 1.0 / term.weight.sqrt();
    match terms {
        [None, None] => f32::INFINITY,
        [Some(term), None] | [None, Some(term)] => alone(term),
        [Some(a), Some(b)] => {
            let sum = a.weight + b.weight;
            let mean = (a.weight * a.offset + b.weight * b.offset) / sum;
            let gap = a.offset - b.offset;
            let rest = 1.0 - a.weight * b.weight / sum * gap * gap;
            let both = mean + (rest.max(0.0) / sum).sqrt();
            // A root below a neighbour would run against the front, so a single axis is used then.
            if rest < 0.0 || both < a.near.max(b.near) { alone(a).min(alone(b)) } else { both }
        }
    }
}
