//! The agent's occupancy map: the floor that it has seen so far.

use crate::{
    Error,
    geometry::{Vec2, distance_2d_m},
    grid::{
        GridSpec,
        bits::BitGrid,
        fast_marching::{Until, Window, march},
    },
    sensors::visible_cells::VisibleCells,
};

/// Value of an unknown cell in [`OccupancyMap::cells`].
pub const UNKNOWN: u8 = 0;
/// Value of a free cell in [`OccupancyMap::cells`].
pub const FREE: u8 = 1;
/// Value of a blocked cell in [`OccupancyMap::cells`].
pub const BLOCKED: u8 = 2;

/// Observed cells that contradict the map, `[row, col]`.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Conflicts {
    /// Cells that were blocked in the map and are now seen free.
    pub freed: Vec<[i32; 2]>,
    /// Cells that were free in the map and are now seen blocked.
    pub obstructed: Vec<[i32; 2]>,
}

impl Conflicts {
    /// Return the number of contradicting cells.
    pub fn len(&self) -> usize {
        self.freed.len() + self.obstructed.len()
    }

    /// Return whether there are no contradicting cells.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Unknown, free and blocked cells, and the cells that were seen from close by (*explored*).
///
/// Cells are observed only by [`OccupancyMap::integrate`]; the last observation of a cell counts.
/// Cells that [`OccupancyMap::assume_free`] has filled in are free until they are seen, and
/// contradict nothing.
#[derive(Debug, Clone, PartialEq)]
pub struct OccupancyMap {
    spec: GridSpec,
    free: BitGrid,
    blocked: BitGrid,
    explored: BitGrid,
    /// Cells that are free by assumption, not by observation.
    assumed: BitGrid,
}

impl OccupancyMap {
    /// Create a map of unknown cells.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] if the grid has no cell, too many cells, or a position that is
    /// not finite.
    pub fn new(spec: GridSpec) -> Result<Self, Error> {
        Error::require("cell_m", spec.cell_m, "finite and > 0", |v| v.is_finite() && v > 0.0)?;
        Error::require_finite("corner_m", &spec.corner_m)?;
        let num_cells = spec.rows as f64 * spec.cols as f64;
        Error::require("rows * cols", num_cells, "in 1..=2^26", |n| {
            n >= 1.0 && n <= crate::grid::MAX_CELLS as f64
        })?;
        let empty = BitGrid::new(spec.rows, spec.cols);
        Ok(Self {
            spec,
            free: empty.clone(),
            blocked: empty.clone(),
            explored: empty.clone(),
            assumed: empty,
        })
    }

    /// Return the shape and position of the map.
    pub fn spec(&self) -> &GridSpec {
        &self.spec
    }

    /// Return the cells known or assumed to be free.
    pub fn free(&self) -> &BitGrid {
        &self.free
    }

    /// Return the cells known to be blocked.
    pub fn blocked(&self) -> &BitGrid {
        &self.blocked
    }

    /// Return the cells seen from close by.
    pub fn explored(&self) -> &BitGrid {
        &self.explored
    }

    /// Return the observed cells that contradict the map; the map does not change.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] if a cell is off the grid.
    pub fn conflicts(&self, seen: &VisibleCells) -> Result<Conflicts, Error> {
        self.check(&seen.free, "free")?;
        self.check(&seen.blocked, "blocked")?;
        let among = |cells: &[[i32; 2]], remembered: &BitGrid, but: Option<&BitGrid>| {
            let contradicts = |cell: &[i32; 2]| {
                let [row, col] = cell.map(|i| i as usize);
                remembered.get(row, col) && !but.is_some_and(|but| but.get(row, col))
            };
            cells.iter().copied().filter(contradicts).collect()
        };
        Ok(Conflicts {
            freed: among(&seen.free, &self.blocked, None),
            obstructed: among(&seen.blocked, &self.free, Some(&self.assumed)),
        })
    }

    /// Add the cells that one view saw; return those that contradicted the map.
    ///
    /// # Arguments
    /// * `origin_m` - `[x, z]` of the place from which the cells were seen.
    /// * `explored_range_m` - seen cells whose centre is nearer than this become explored.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] if a cell is off the grid or a number not finite; the map is then unchanged.
    pub fn integrate(
        &mut self,
        seen: &VisibleCells,
        origin_m: Vec2,
        explored_range_m: f64,
    ) -> Result<Conflicts, Error> {
        check_disc(origin_m, explored_range_m, "origin_m", "explored_range_m")?;
        let conflicts = self.conflicts(seen)?;
        let range2 = explored_range_m * explored_range_m;
        let lists = [(&seen.free, true), (&seen.blocked, false)];
        for (cells, is_free) in lists {
            for cell in cells {
                let [row, col] = cell.map(|i| i as usize);
                let (now, before) = if is_free {
                    (&mut self.free, &mut self.blocked)
                } else {
                    (&mut self.blocked, &mut self.free)
                };
                now.insert(row, col);
                before.remove(row, col);
                self.assumed.remove(row, col);
                if self.distance2_m2([row, col], origin_m) < range2 {
                    self.explored.insert(row, col);
                }
            }
        }
        Ok(conflicts)
    }

    /// Mark the free cells around a place as explored (3D-Mem: 0.7 m around the agent after each
    /// move).
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] if a number is not finite.
    pub fn explore_around(&mut self, centre_m: Vec2, radius_m: f64) -> Result<(), Error> {
        check_disc(centre_m, radius_m, "centre_m", "radius_m")?;
        for [row, col] in self.disc(centre_m, radius_m) {
            if self.free.get(row, col) {
                self.explored.insert(row, col);
            }
        }
        Ok(())
    }

    /// Assume that the unknown cells around a place are free and explored until they are seen
    /// (3D-Mem: 0.6 m around the agent's start, which no camera sees).
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] if a number is not finite.
    pub fn assume_free(&mut self, centre_m: Vec2, radius_m: f64) -> Result<(), Error> {
        check_disc(centre_m, radius_m, "centre_m", "radius_m")?;
        for [row, col] in self.disc(centre_m, radius_m) {
            if !self.free.get(row, col) && !self.blocked.get(row, col) {
                self.free.insert(row, col);
                self.assumed.insert(row, col);
            }
            if self.free.get(row, col) {
                self.explored.insert(row, col);
            }
        }
        Ok(())
    }

    /// Forget everything.
    pub fn clear(&mut self) {
        for plane in [&mut self.free, &mut self.blocked, &mut self.explored, &mut self.assumed] {
            plane.clear();
        }
    }

    /// Forget the given cells; they become unknown and unexplored.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] if a cell is off the grid; the map is then unchanged.
    pub fn forget(&mut self, cells: &[[i32; 2]]) -> Result<(), Error> {
        self.check(cells, "cells")?;
        for cell in cells {
            let [row, col] = cell.map(|i| i as usize);
            for plane in [&mut self.free, &mut self.blocked, &mut self.explored, &mut self.assumed]
            {
                plane.remove(row, col);
            }
        }
        Ok(())
    }

    /// Return the lengths of the shortest ways over free cells from a start to targets.
    ///
    /// # Returns
    /// Metres between the cells' centres; infinite for targets that free cells do not connect with
    /// the start, and for all if the start is off the map.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] if a coordinate is not finite.
    ///
    /// # Complexity
    /// O(n log n) for n free cells that are nearer than the farthest target.
    pub fn distances_m(&self, start_m: Vec2, targets_m: &[Vec2]) -> Result<Vec<f64>, Error> {
        Error::require_finite("start_m", &start_m)?;
        Error::require_finite("targets_m", targets_m.as_flattened())?;
        let Some(own) = self.spec.cell_of(start_m) else {
            return Ok(vec![f64::INFINITY; targets_m.len()]);
        };
        let cells: Vec<_> = targets_m.iter().map(|&target_m| self.spec.cell_of(target_m)).collect();
        let mut start = BitGrid::new(self.spec.rows, self.spec.cols);
        start.insert(own[0], own[1]);
        let ends: Vec<_> = cells.iter().flatten().copied().collect();
        let window = Window { first: [0, 0], shape: [self.spec.rows, self.spec.cols] };
        let field = march(&self.free, &start, window, Until::All(&ends));
        // The front bends most beside its start, and is up to 1% ahead of itself from there on.
        let cells_from_start = |cell: [usize; 2]| {
            let straight = distance_2d_m(cell.map(|i| i as f64), own.map(|i| i as f64));
            f64::from(field.at(cell)).max(straight)
        };
        let length_m = |cell: Option<[usize; 2]>| {
            cell.map_or(f64::INFINITY, |cell| cells_from_start(cell) * self.spec.cell_m)
        };
        Ok(cells.into_iter().map(length_m).collect())
    }

    /// Return one value per cell, row-major: [`UNKNOWN`], [`FREE`] or [`BLOCKED`].
    pub fn cells(&self) -> Vec<u8> {
        let mut cells = vec![UNKNOWN; self.spec.len()];
        for (plane, value) in [(&self.free, FREE), (&self.blocked, BLOCKED)] {
            for cell in plane.cells() {
                cells[self.spec.index(cell)] = value;
            }
        }
        cells
    }

    fn check(&self, cells: &[[i32; 2]], name: &str) -> Result<(), Error> {
        let (rows, cols) = (self.spec.rows, self.spec.cols);
        let is_outside = |cell: &&[i32; 2]| {
            let [row, col] = cell.map(|i| usize::try_from(i).unwrap_or(usize::MAX));
            row >= rows || col >= cols
        };
        let Some(cell) = cells.iter().find(is_outside) else { return Ok(()) };
        Err(Error::invalid(name, format!("{cell:?}"), "cells of the map"))
    }

    fn distance2_m2(&self, cell: [usize; 2], point_m: Vec2) -> f64 {
        let centre_m = self.spec.centre_m(cell);
        (centre_m[0] - point_m[0]).powi(2) + (centre_m[1] - point_m[1]).powi(2)
    }

    /// Return the cells whose centre is nearer than `radius_m`.
    fn disc(&self, centre_m: Vec2, radius_m: f64) -> Vec<[usize; 2]> {
        let index = |value_m: f64, axis: usize, num: usize| {
            ((value_m - self.spec.corner_m[axis]) / self.spec.cell_m).clamp(0.0, num as f64)
                as usize
        };
        let span = |axis: usize, num: usize| {
            let end = index(centre_m[axis] + radius_m, axis, num) + 1;
            index(centre_m[axis] - radius_m, axis, num)..end.min(num)
        };
        let cols = span(0, self.spec.cols);
        span(1, self.spec.rows)
            .flat_map(|row| cols.clone().map(move |col| [row, col]))
            .filter(|&cell| self.distance2_m2(cell, centre_m) < radius_m * radius_m)
            .collect()
    }
}

fn check_disc(
    centre_m: Vec2,
    radius_m: f64,
    centre_name: &str,
    radius_name: &str,
) -> Result<(), Error> {
    Error::require_finite(centre_name, &centre_m)?;
    Error::require(radius_name, radius_m, "finite and >= 0", |v| v.is_finite() && v >= 0.0)
}
