//! Plan paths: distances to a goal, and a short-term goal on the way to it.

use crate::{
    Error,
    geometry::{Vec2, distance_2d_m},
    grid::{
        bits::BitGrid,
        dilate::dilate_disk,
        fast_marching::{Field, Until, Window, flood, march},
    },
    unigoal::bev_map::BevMap,
};

/// The cell that the agent should move to next.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShortTermGoal {
    /// The cell, `[row, col]`.
    pub cell: [usize; 2],
    /// Difference between the agent's and the cell's distance to the goal, in cells.
    pub gain: f32,
}

/// Return the cell on a circle around the agent that is nearest to the goal by `field`.
///
/// A cell that gains more than 1.5 times its straight distance is beyond a wall that is thinner
/// than the circle is wide; it is skipped, as in UniGoal.
///
/// # Arguments
/// * `field` - distances to the goal, at least up to the agent's.
/// * `position` - `[row, col]` of the agent in cells; fractions count from a cell's lower corner.
/// * `radius` - radius of the circle, in cells; cells farther than `radius - 1` and up to `radius`
///   are on it.
///
/// # Returns
/// The best cell, of equals the first in row-major order; `None` if no cell of the circle is nearer
/// to the goal than the agent's own, or the goal cannot be reached from there.
pub fn short_term_goal(field: &Field, position: [f64; 2], radius: usize) -> Option<ShortTermGoal> {
    let cell = position.map(f64::floor);
    if position.iter().any(|p| !p.is_finite() || *p < 0.0) {
        return None;
    }
    let own = field.at(cell.map(|c| c as usize));
    if !own.is_finite() {
        return None;
    }
    let reach = radius as i64 + 1;
    let mut best: Option<ShortTermGoal> = None;
    for d_row in -reach..=reach {
        for d_col in -reach..=reach {
            let at = [cell[0] as i64 + d_row, cell[1] as i64 + d_col];
            let Ok(row) = usize::try_from(at[0]) else { continue };
            let Ok(col) = usize::try_from(at[1]) else { continue };
            let offset = [0, 1].map(|i| at[i] as f64 + 0.5 - position[i]);
            let far = offset[0].hypot(offset[1]);
            if far > radius as f64 || far <= radius as f64 - 1.0 {
                continue;
            }
            let gain = own - field.at([row, col]);
            let is_beyond_wall = f64::from(gain) > 1.5 * far.max(radius as f64);
            if gain > 1e-4 && !is_beyond_wall && best.is_none_or(|b| gain > b.gain) {
                best = Some(ShortTermGoal { cell: [row, col], gain });
            }
        }
    }
    best
}

/// Parameters of [`plan`]; the defaults are UniGoal's constants.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlanConfig {
    /// Number of cells by which obstacles are grown.
    pub obstacle_radius: usize,
    /// Number of cells by which paths may leave the known part of the map.
    pub margin: usize,
    /// Radius, in cells, of the circle on which the short-term goal lies.
    pub circle: usize,
    /// Radius, in cells, of the circle that is tried if the first has no short-term goal.
    pub small_circle: usize,
}

impl Default for PlanConfig {
    fn default() -> Self {
        Self { obstacle_radius: 3, margin: 20, circle: 5, small_circle: 2 }
    }
}

/// The part of a path to a goal that the agent needs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plan {
    /// Length of the path to the nearest goal cell; `None` if there is none.
    pub distance_m: Option<f64>,
    /// Straight distance to the nearest goal cell's centre; infinite if no goal is on the map.
    pub straight_m: f64,
    /// Point `[x, z]` to move to. Without a path to the goal it is on the path to the reachable
    /// cell nearest to the goal. `None` if the agent is at the goal or at that cell.
    pub short_term_m: Option<Vec2>,
}

/// Plan a path from a point to the nearest of some goal cells.
///
/// # Arguments
/// * `agent_m` - position of the agent, `[x, z]`, on the map.
/// * `goals` - goal cells, `[row, col]`; those off the map are left out.
/// * `goal_radius` - number of cells by which goal cells are grown; they are passable.
///
/// # Errors
/// [`Error::InvalidArgument`] if the agent is off the map.
///
/// # Complexity
/// O(n log n) for n cells nearer to the goal than the agent.
pub fn plan(
    map: &BevMap,
    agent_m: Vec2,
    goals: &[[i32; 2]],
    goal_radius: usize,
    config: &PlanConfig,
) -> Result<Plan, Error> {
    let spec = map.spec();
    let agent = map.require_cell("agent_m", agent_m)?;
    let mut on_map = BitGrid::new(spec.rows, spec.cols);
    for [row, col] in goals {
        if let (Ok(row), Ok(col)) = (usize::try_from(*row), usize::try_from(*col)) {
            on_map.insert(row, col);
        }
    }
    let seeds = dilate_disk(&on_map, goal_radius);
    let mut ends: Vec<[usize; 2]> = seeds.cells().collect();
    let straight_m = |cell: &[usize; 2]| distance_2d_m(spec.centre_m(*cell), agent_m);
    let straight_m = ends.iter().map(straight_m).fold(f64::INFINITY, f64::min);
    if ends.is_empty() {
        return Ok(Plan { distance_m: None, straight_m, short_term_m: None });
    }
    ends.push(agent);
    let passable = map.traversable(agent, config.obstacle_radius);
    let window = map.window(&ends, config.margin);
    let mut field = march(&passable, &seeds, window, Until::All(&[agent]));
    let cells = f64::from(field.at(agent));
    if !cells.is_finite() {
        let nearest = nearest_reachable(&passable, agent, &seeds, window);
        field = march(&passable, &nearest, window, Until::All(&[agent]));
    }
    let position = [1, 0].map(|axis: usize| (agent_m[axis] - spec.corner_m[axis]) / spec.cell_m);
    let short_term = short_term_goal(&field, position, config.circle)
        .or_else(|| short_term_goal(&field, position, config.small_circle));
    Ok(Plan {
        distance_m: cells.is_finite().then_some(cells * spec.cell_m),
        straight_m,
        short_term_m: short_term.map(|goal| spec.centre_m(goal.cell)),
    })
}

/// Return the reachable cell that is nearest to some goals.
fn nearest_reachable(
    passable: &BitGrid,
    agent: [usize; 2],
    goals: &BitGrid,
    window: Window,
) -> BitGrid {
    let reachable = flood(passable, agent, window);
    let mut open = BitGrid::new(passable.rows(), passable.cols());
    open.invert();
    let field = march(&open, goals, window, Until::Any(&reachable));
    let mut nearest = BitGrid::new(passable.rows(), passable.cols());
    if let Some([row, col]) = field.last {
        nearest.insert(row, col);
    }
    nearest
}
