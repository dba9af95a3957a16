//! The outline of a house on a grid: a rectangle with cut corners.

use crate::{
    house_generation::{
        parameters::{RoomSpec, Structure},
        sampling::{beta, choose},
    },
    rng::Stream,
};

/// A cell of a floor plan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Cell {
    /// A cell outside the house.
    Outside,
    /// A cell inside, of no room yet.
    Empty,
    /// A cell of a room or group of rooms.
    Of(usize),
}

/// The cells of a house, along x and z.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Cells {
    /// Number of cells along x and z.
    pub size: [usize; 2],
    cells: Vec<Cell>,
}

impl Cells {
    /// Create cells of no room yet.
    pub(super) fn empty(size: [usize; 2]) -> Self {
        Self { size, cells: vec![Cell::Empty; size[0] * size[1]] }
    }

    pub(super) fn get(&self, x: usize, z: usize) -> Cell {
        self.cells[x * self.size[1] + z]
    }

    /// Return a cell, [`Cell::Outside`] beyond the grid.
    pub(super) fn at(&self, x: i64, z: i64) -> Cell {
        let inside =
            |v: i64, axis: usize| usize::try_from(v).ok().filter(|&index| index < self.size[axis]);
        inside(x, 0).zip(inside(z, 1)).map_or(Cell::Outside, |(x, z)| self.get(x, z))
    }

    pub(super) fn set(&mut self, x: usize, z: usize, cell: Cell) {
        self.cells[x * self.size[1] + z] = cell;
    }

    pub(super) fn count(&self, cell: Cell) -> usize {
        self.cells.iter().filter(|&&other| other == cell).count()
    }
}

/// Draw the outline of a house with `num_rooms` rooms (`interior_boundaries` of the package
/// `procthor`).
pub(super) fn sample_boundary(
    parameters: &Structure,
    spec: &RoomSpec,
    num_rooms: usize,
    stream: &mut Stream,
) -> Cells {
    let size = match spec.cells {
        Some(ranges) => ranges.map(|[least, most]| least + stream.below(most + 1 - least)),
        None => {
            // Half a room less to half a room more; all are rounded down, as in Python.
            let side = (num_rooms as f64).sqrt() * parameters.room_cells;
            let half = (0.5 * parameters.room_cells).floor();
            let least = (side - half).max(parameters.min_side_cells as f64) as usize;
            let most = ((side + half) as usize).max(least.max(1));
            [0, 1].map(|_| least.max(1) + stream.below(most + 1 - least.max(1)))
        }
    };
    let mut cells = Cells::empty(size);
    let shape = [parameters.cut_alpha_per_room * num_rooms as f64, parameters.cut_beta];
    let num_cuts = (parameters.cut_scale * beta(stream, shape)).round() as usize;
    for _ in 0..num_cuts {
        cut_corner(&mut cells, parameters.max_cut_cells, stream);
    }
    cells
}

/// Cut a rectangle out of one of the corners.
fn cut_corner(cells: &mut Cells, max_cells: usize, stream: &mut Stream) {
    let [num_x, num_z] = cells.size;
    let corner = stream.below(4);
    let longest = num_z.saturating_sub(1).min(max_cells / 2).max(2) - 1;
    let z_cut = 1 + stream.below(longest);
    let x_cuts: Vec<usize> = (1..num_x).take_while(|x_cut| z_cut * x_cut <= max_cells).collect();
    let Some(&x_cut) = choose(stream, &x_cuts) else { return };
    for x in 0..x_cut {
        for z in 0..z_cut.min(num_z) {
            let x = if corner < 2 { x } else { num_x - 1 - x };
            let z = if corner.is_multiple_of(2) { z } else { num_z - 1 - z };
            cells.set(x, z, Cell::Outside);
        }
    }
}
