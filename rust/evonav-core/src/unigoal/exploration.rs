//! Choose where to explore: frontier cells, scored by their distance.

use crate::{
    grid::{
        bits::BitGrid,
        components::{Components, Run},
        dilate::dilate_disk,
        fast_marching::{Until, march},
    },
    unigoal::bev_map::BevMap,
};

/// Parameters of frontiers and their scores; the defaults are UniGoal's constants.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExploreConfig {
    /// Number of cells by which obstacles are grown to find frontiers.
    pub frontier_obstacle_radius: usize,
    /// Smallest number of cells of a frontier.
    pub min_cells: usize,
    /// Smallest distance of a frontier.
    pub min_distance_m: f64,
    /// Distance beyond `min_distance_m` up to which distances change the score.
    pub span_m: f64,
    /// Number of cells by which obstacles are grown for paths.
    pub path_obstacle_radius: usize,
    /// Number of cells by which paths may leave the known part of the map.
    pub margin: usize,
}

impl Default for ExploreConfig {
    fn default() -> Self {
        Self {
            frontier_obstacle_radius: 4,
            min_cells: 20,
            min_distance_m: 1.2,
            span_m: 10.0,
            path_obstacle_radius: 3,
            margin: 20,
        }
    }
}

/// A frontier cell with its score.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScoredCell {
    /// The cell, `[row, col]`.
    pub cell: [usize; 2],
    /// Length of the path from the agent.
    pub distance_m: f64,
    /// Length of the path from the mid-term goal, if there is one.
    pub goal_distance_m: Option<f64>,
    /// Score: 10 for the nearest frontiers to 0 for those 10 m farther; up to 1 more near the goal.
    pub score: f64,
}

/// Return the explored cells away from obstacles that touch unknown cells, in 8-connected groups of
/// at least `min_cells`.
pub fn frontier_cells(map: &BevMap, config: &ExploreConfig) -> BitGrid {
    let near_obstacles = dilate_disk(map.obstacles(), config.frontier_obstacle_radius);
    let mut free = map.explored().clone();
    free.subtract(&near_obstacles);
    let mut unknown = map.explored().clone();
    unknown.unite(&near_obstacles);
    unknown.invert();
    let mut frontier = dilate_disk(&unknown, 1);
    frontier.intersect(&free);
    keep_large(&frontier, config.min_cells)
}

/// Return the 8-connected groups of at least `min_cells` cells.
pub fn keep_large(cells: &BitGrid, min_cells: usize) -> BitGrid {
    let mut large = BitGrid::new(cells.rows(), cells.cols());
    for group in Components::with_corners(cells).by_component().iter() {
        if group.iter().map(Run::len).sum::<usize>() >= min_cells {
            for run in group {
                large.insert_run(run.row as usize, run.start as usize, run.end as usize);
            }
        }
    }
    large
}

/// Choose the frontier cell to explore from `agent`: mostly the nearest; `goal` decides among cells
/// at similar distances.
///
/// # Returns
/// The best cell, of equals the first in row-major order; `None` if no frontier that is far enough
/// away can be reached.
///
/// # Source
/// UniGoal: score 10 - (clip(d, 0, 11.2) - 1.2), plus 1 - (clip(dg, 0, 11.2) - 1.2) / 10.
pub fn choose_frontier(
    map: &BevMap,
    agent: [usize; 2],
    goal: Option<[usize; 2]>,
    config: &ExploreConfig,
) -> Option<ScoredCell> {
    let frontiers: Vec<[usize; 2]> = frontier_cells(map, config).cells().collect();
    if frontiers.is_empty() {
        return None;
    }
    let passable = map.traversable(agent, config.path_obstacle_radius);
    let ends: Vec<[usize; 2]> = [agent].into_iter().chain(goal).collect();
    let window = map.window(&ends, config.margin);
    let field_from = |start: [usize; 2]| {
        let mut seeds = BitGrid::new(map.spec().rows, map.spec().cols);
        seeds.insert(start[0], start[1]);
        march(&passable, &seeds, window, Until::All(&frontiers))
    };
    let from_agent = field_from(agent);
    let from_goal = goal.map(field_from);
    let cell_m = map.spec().cell_m;
    let most_m = config.min_distance_m + config.span_m;
    let score = |cell: [usize; 2]| {
        let distance_m = f64::from(from_agent.at(cell)) * cell_m;
        let is_candidate = distance_m.is_finite() && distance_m >= config.min_distance_m;
        let goal_distance_m = from_goal.as_ref().map(|field| f64::from(field.at(cell)) * cell_m);
        let near = |d_m: f64| d_m.clamp(0.0, most_m) - config.min_distance_m;
        let bonus = goal_distance_m.map_or(0.0, |d_m| 1.0 - near(d_m) / config.span_m);
        let score = config.span_m - near(distance_m) + bonus;
        is_candidate.then_some(ScoredCell { cell, distance_m, goal_distance_m, score })
    };
    let scored = frontiers.iter().filter_map(|&cell| score(cell));
    scored.fold(None, |best: Option<ScoredCell>, next| match best {
        Some(best) if next.score <= best.score => Some(best),
        _ => Some(next),
    })
}
