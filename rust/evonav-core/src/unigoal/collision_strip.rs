//! The cells ahead that are marked as blocked after a move that failed.

use crate::{
    geometry::{Pose, Vec2},
    grid::GridSpec,
};

/// A strip of cells in front of the agent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Strip {
    /// Number of cells from the agent to the strip.
    pub start: usize,
    /// Number of cells along the heading.
    pub length: usize,
    /// Number of cells across the heading.
    pub width: usize,
}

/// Return the cells of the map that a strip covers; UniGoal marks them as blocked when a move
/// fails.
///
/// # Returns
/// Cells `[row, col]`, nearest first, some perhaps twice; cells off the map are left out.
pub fn strip_cells(spec: &GridSpec, pose: &Pose, strip: Strip) -> Vec<[usize; 2]> {
    let (sin, cos) = pose.yaw_rad.sin_cos();
    let [x, _, z] = pose.position_m;
    let point = |ahead: f64, right: f64| -> Vec2 {
        [x + ahead * sin + right * cos, z + ahead * cos - right * sin]
    };
    let half = (strip.width / 2) as f64;
    let cells = (0..strip.length)
        .flat_map(|i| (0..strip.width).map(move |j| [(i + strip.start) as f64, j as f64 - half]));
    cells
        .filter_map(|[ahead, right]| spec.cell_of(point(ahead * spec.cell_m, right * spec.cell_m)))
        .collect()
}
