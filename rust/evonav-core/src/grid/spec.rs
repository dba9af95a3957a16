//! Regular grids on the ground plane, `[row = z, col = x]`, row-major.

use crate::{Error, geometry::Vec2};

/// Shape and position of a grid of square cells.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GridSpec {
    /// Number of rows (z).
    pub rows: usize,
    /// Number of columns (x).
    pub cols: usize,
    /// Edge length of a cell.
    pub cell_m: f64,
    /// `[x, z]` of the corner of cell (0, 0) with the smallest coordinates.
    pub corner_m: Vec2,
}

/// Largest number of cells of a grid: 64 Mi, an 800 m square at 0.1 m.
pub const MAX_CELLS: usize = 1 << 26;

impl GridSpec {
    /// Create the smallest grid whose cells, aligned to multiples of `cell_m`, cover the rectangle.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] if a number is not finite, `cell_m` not positive, or the grid too large.
    pub fn covering(min_m: Vec2, max_m: Vec2, cell_m: f64) -> Result<Self, Error> {
        Error::require("cell_m", cell_m, "finite and > 0", |v| v.is_finite() && v > 0.0)?;
        for value in [min_m[0], min_m[1], max_m[0], max_m[1]] {
            Error::require("bounds_m", value, "finite", f64::is_finite)?;
        }
        let low = min_m.map(|v| (v / cell_m).floor());
        let count = [0, 1].map(|i| ((max_m[i] / cell_m).ceil() - low[i]).max(1.0));
        Error::require("cells", count[0] * count[1], "at most 2^26", |n| n <= MAX_CELLS as f64)?;
        Ok(Self {
            rows: count[1] as usize,
            cols: count[0] as usize,
            cell_m,
            corner_m: low.map(|v| v * cell_m),
        })
    }

    /// Return the number of cells.
    pub fn len(&self) -> usize {
        self.rows * self.cols
    }

    /// Return whether the grid has no cell.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Return `[row, col]` of the cell that contains the point, `None` outside.
    pub fn cell_of(&self, point_m: Vec2) -> Option<[usize; 2]> {
        let col = ((point_m[0] - self.corner_m[0]) / self.cell_m).floor();
        let row = ((point_m[1] - self.corner_m[1]) / self.cell_m).floor();
        let is_inside =
            row >= 0.0 && col >= 0.0 && row < self.rows as f64 && col < self.cols as f64;
        is_inside.then_some([row as usize, col as usize])
    }

    /// Return `[x, z]` of a cell's centre.
    pub fn centre_m(&self, cell: [usize; 2]) -> Vec2 {
        [
            self.corner_m[0] + (cell[1] as f64 + 0.5) * self.cell_m,
            self.corner_m[1] + (cell[0] as f64 + 0.5) * self.cell_m,
        ]
    }

    /// Return the index of a cell in row-major storage.
    pub fn index(&self, cell: [usize; 2]) -> usize {
        cell[0] * self.cols + cell[1]
    }
}
