//! Visibility on an occupancy grid: the cells of the oracle's map that an agent sees from one pose.

use std::f64::consts::{FRAC_PI_2, SQRT_2, TAU};

use crate::{Error, geometry::Vec2, grid::GridSpec};

/// The cells that rays from one place reach, `[row, col]`, each list in row-major order.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct VisibleCells {
    /// Free cells that a ray enters.
    pub free: Vec<[i32; 2]>,
    /// Blocked cells that end a ray.
    pub blocked: Vec<[i32; 2]>,
}

/// Width, as a share of a quadrant, below which a beam is due to rounding and sees nothing.
const MIN_BEAM: f64 = 1e-9;
/// Distance, in cells, by which an origin on the border of its cell is moved inside.
const BORDER: f64 = 1e-6;

/// Return the cells that the rays of a planar field of view reach.
///
/// Every direction is cast, not a sample of directions: a cell is visible if a beam of non-zero
/// width enters it within `range_m` and crosses no blocked cell before. The cell of the origin is
/// always visible and never blocks the view, so an agent that touches an obstacle is not blind.
///
/// # Arguments
/// * `blocked` - occupancy, row-major, shape `(spec.rows, spec.cols)`; non-zero is blocked.
///   Everything outside the grid is opaque.
/// * `origin_m` - `[x, z]`, world frame.
/// * `yaw_rad` - middle of the field of view; 0 along +z, growing towards +x.
/// * `horizontal_fov_rad` - width of the field of view, at most a full turn.
/// * `range_m` - largest distance of the point at which a ray enters a cell.
///
/// # Errors
/// [`Error::InvalidArgument`] if `blocked` is not as large as the grid, the origin is off the
/// grid, or a number is not finite or outside its domain.
///
/// # Complexity
/// O(cells within range), each visited once per quadrant. The cells at one Manhattan distance split
/// a quadrant's directions into equal parts of `v / (u + v)`, and a ray crosses the distances in
/// order. So the visible directions are a sorted list of beams, from which blocked cells are cut
/// distance by distance.
pub fn visible_cells(
    blocked: &[u8],
    spec: &GridSpec,
    origin_m: Vec2,
    yaw_rad: f64,
    horizontal_fov_rad: f64,
    range_m: f64,
) -> Result<VisibleCells, Error> {
    if blocked.len() != spec.len() {
        return Err(Error::invalid("blocked", blocked.len(), "one value a cell of the grid"));
    }
    Error::require("yaw_rad", yaw_rad, "finite", f64::is_finite)?;
    Error::require("horizontal_fov_rad", horizontal_fov_rad, "in (0, 2 pi]", |v| {
        v > 0.0 && v <= TAU + 1e-9
    })?;
    Error::require("range_m", range_m, "finite and > 0", |v| v.is_finite() && v > 0.0)?;
    let own = spec
        .cell_of(origin_m)
        .ok_or_else(|| Error::invalid("origin_m", format!("{origin_m:?}"), "on the grid"))?;
    let mut view = View::new(blocked, spec, own, range_m / spec.cell_m);
    // Offsets of the origin in its cell along rows (z) and columns (x).
    let offset = [1, 0].map(|axis| {
        let index = own[1 - axis] as f64;
        ((origin_m[axis] - spec.corner_m[axis]) / spec.cell_m - index).clamp(BORDER, 1.0 - BORDER)
    });
    let first_rad = (yaw_rad - 0.5 * horizontal_fov_rad).rem_euclid(TAU);
    for quadrant in 0..4 {
        let beams = beams_in_quadrant(quadrant, first_rad, horizontal_fov_rad);
        view.sweep(Quadrant::new(quadrant, offset), beams);
    }
    Ok(view.collect())
}

/// A closed range of directions inside one quadrant, as `v / (u + v)`: 0 along u, 1 along v.
type Beam = [f64; 2];

/// Return the part of the field of view inside quadrant `quadrant` (directions from `quadrant` to
/// `quadrant + 1` quarter turns); two parts if the field begins and ends there.
fn beams_in_quadrant(quadrant: u8, first_rad: f64, fov_rad: f64) -> Vec<Beam> {
    let low = f64::from(quadrant) * FRAC_PI_2;
    let of_angle = |angle_rad: f64| {
        let (sin, cos) = (angle_rad - low).sin_cos();
        (sin / (sin + cos)).clamp(0.0, 1.0)
    };
    // The field may pass a full turn, so the quadrant one turn further is used as well.
    let mut beams: Vec<Beam> = [0.0, TAU]
        .into_iter()
        .filter_map(|turn| {
            let start = first_rad.max(low + turn) - turn;
            let end = (first_rad + fov_rad).min(low + FRAC_PI_2 + turn) - turn;
            (end > start).then(|| [of_angle(start), of_angle(end)])
        })
        .collect();
    beams.sort_by(|a, b| a[0].total_cmp(&b[0]));
    beams
}

/// A quarter of the directions around the origin, in axes u and v that point away from it.
struct Quadrant {
    /// `[row, col]` step of one cell along u and along v.
    steps: [[i64; 2]; 2],
    /// Distance of the origin from the near side of its cell along u and along v, in cells.
    inside: [f64; 2],
}

impl Quadrant {
    /// Create a quadrant; `offset` is the origin's position in its cell along rows and columns, in
    /// cells.
    fn new(quadrant: u8, offset: [f64; 2]) -> Self {
        let (up, right, down, left) = ([1, 0], [0, 1], [-1, 0], [0, -1]);
        let steps = match quadrant {
            0 => [up, right],
            1 => [right, down],
            2 => [down, left],
            _ => [left, up],
        };
        let inside = steps.map(|step| {
            let along = offset[usize::from(step[0] == 0)];
            if step[0] + step[1] > 0 { along } else { 1.0 - along }
        });
        Self { steps, inside }
    }

    /// Return the distance in cells, along one axis, from the origin to the near side of the
    /// `index`-th cell.
    fn near(&self, axis: usize, index: usize) -> f64 {
        (index as f64 - self.inside[axis]).max(0.0)
    }

    /// Return whether a ray of `beam` enters cell `[i, j]` of (u, v) within `range` cells.
    fn is_within(&self, cell: [usize; 2], beam: Beam, range: f64) -> bool {
        let [u, v] = [self.near(0, cell[0]), self.near(1, cell[1])];
        let range2 = range * range;
        if u * u + v * v > range2 {
            return false;
        }
        if (u + 1.0) * (u + 1.0) + (v + 1.0) * (v + 1.0) <= range2 {
            return true;
        }
        // The nearest point of entry is the near corner, or the point on the beam's edge closest to
        // it.
        let side = if u + v > 0.0 { (v / (u + v)).clamp(beam[0], beam[1]) } else { beam[0] };
        let along_u = if u > 0.0 { u / (1.0 - side) } else { 0.0 };
        let along_v = if v > 0.0 { v / side } else { 0.0 };
        let entry = along_u.max(along_v);
        entry * entry * (side * side + (1.0 - side) * (1.0 - side)) <= range2
    }
}

/// The cells seen so far, in a window around the origin.
struct View<'a> {
    blocked: &'a [u8],
    spec: &'a GridSpec,
    own: [usize; 2],
    range_cells: f64,
    low: [usize; 2],
    shape: [usize; 2],
    is_seen: Vec<bool>,
}

impl<'a> View<'a> {
    fn new(blocked: &'a [u8], spec: &'a GridSpec, own: [usize; 2], range_cells: f64) -> Self {
        let reach = range_cells.min((spec.rows + spec.cols) as f64).ceil() as usize + 1;
        let low = own.map(|i| i.saturating_sub(reach));
        let shape = [
            (own[0] + reach + 1).min(spec.rows) - low[0],
            (own[1] + reach + 1).min(spec.cols) - low[1],
        ];
        let mut view = Self {
            blocked,
            spec,
            own,
            range_cells,
            low,
            shape,
            is_seen: vec![false; shape[0] * shape[1]],
        };
        view.see([own[0] as i64, own[1] as i64]);
        view
    }

    /// Return whether a cell lets no ray pass. Cells outside the window are off the grid or out of
    /// range.
    fn is_opaque(&self, cell: [i64; 2]) -> bool {
        match self.window_index(cell) {
            Some(_) => self.blocked[cell[0] as usize * self.spec.cols + cell[1] as usize] != 0,
            None => true,
        }
    }

    fn window_index(&self, cell: [i64; 2]) -> Option<usize> {
        let row = cell[0] - self.low[0] as i64;
        let col = cell[1] - self.low[1] as i64;
        let is_inside =
            row >= 0 && col >= 0 && row < self.shape[0] as i64 && col < self.shape[1] as i64;
        is_inside.then(|| row as usize * self.shape[1] + col as usize)
    }

    fn see(&mut self, cell: [i64; 2]) {
        if let Some(index) = self.window_index(cell) {
            self.is_seen[index] = true;
        }
    }

    fn sweep(&mut self, quadrant: Quadrant, mut beams: Vec<Beam>) {
        let mut next = Vec::new();
        let last_ring = (self.range_cells * SQRT_2).min((self.spec.rows + self.spec.cols) as f64);
        for ring in 1..=last_ring as usize + 2 {
            if beams.is_empty() {
                return;
            }
            // The side of cell j that it shares with cell j - 1 of the ring.
            let total = (ring + 1) as f64 - quadrant.inside[0] - quadrant.inside[1];
            let per_cell = 1.0 / total;
            let side = |j: usize| match j {
                0 => 0.0,
                j if j > ring => 1.0,
                j => (j as f64 - quadrant.inside[1]) * per_cell,
            };
            for &[from, to] in &beams {
                let first = (from * total + quadrant.inside[1]).max(0.0) as usize;
                let mut open_from = from;
                for j in first.min(ring)..=ring {
                    let part = [side(j).max(from), side(j + 1).min(to)];
                    if part[1] - part[0] > MIN_BEAM && self.reach(&quadrant, [ring - j, j], part) {
                        if part[0] - open_from > MIN_BEAM {
                            next.push([open_from, part[0]]);
                        }
                        open_from = part[1];
                    }
                    if side(j + 1) >= to {
                        break;
                    }
                }
                if to - open_from > MIN_BEAM {
                    next.push([open_from, to]);
                }
            }
            beams.clear();
            std::mem::swap(&mut beams, &mut next);
        }
    }

    /// Mark a cell as seen if it lies within range; return whether it stops the beam.
    fn reach(&mut self, quadrant: &Quadrant, at: [usize; 2], beam: Beam) -> bool {
        let cell = [0, 1].map(|axis| {
            self.own[axis] as i64
                + quadrant.steps[0][axis] * at[0] as i64
                + quadrant.steps[1][axis] * at[1] as i64
        });
        if quadrant.is_within(at, beam, self.range_cells) {
            self.see(cell);
        }
        self.is_opaque(cell)
    }

    fn collect(self) -> VisibleCells {
        let mut seen = VisibleCells::default();
        for (row, cells) in self.is_seen.chunks_exact(self.shape[1].max(1)).enumerate() {
            for (col, _) in cells.iter().enumerate().filter(|(_, is_seen)| **is_seen) {
                let cell = [self.low[0] + row, self.low[1] + col];
                let list = match self.blocked[self.spec.index(cell)] {
                    0 => &mut seen.free,
                    _ => &mut seen.blocked,
                };
                list.push([cell[0] as i32, cell[1] as i32]);
            }
        }
        seen
    }
}
