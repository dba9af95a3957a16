//! The free space of a scene: where an agent can stand, how it can move, and shortest paths.

use std::{cell::Cell, sync::OnceLock};

use crate::{
    Error,
    geometry::{Vec2, bounds_2d_m, distance_2d_m},
    grid::{GridSpec, MAX_CELLS},
    world::{
        footprint::footprint,
        navigation::{
            AgentBody, DistanceField, Obstacle, Obstacles, VisibilityGraph, obstacle::Gist,
            obstacles::NONE,
        },
        scene::{BodyKind, Scene},
    },
};

/// Parameters of the free space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NavigationConfig {
    /// Height below which parts are walked over: rugs, sheets of paper, door sills.
    pub step_height_m: f64,
    /// Largest depth of the agent's side in an obstacle at which the agent is still free. Scenes
    /// are not exact: wall sides stand 5 mm inside the planes of the house file, and the
    /// catalogue's boxes, which include handles and cushions that AI2-THOR's colliders leave out,
    /// are off by 3-7 mm (median).
    pub tolerance_m: f64,
    /// Largest distance by which [`Navigation::snap`] moves a point.
    pub snap_m: f64,
}

impl Default for NavigationConfig {
    fn default() -> Self {
        Self { step_height_m: 0.03, tolerance_m: 0.01, snap_m: 0.5 }
    }
}

/// Largest distance from the floors at which a point is still indoors: rooms' floors end under the
/// walls.
const FLOOR_SLACK_M: f64 = 0.05;
/// Margin of maps around the house, so that its walls are on them.
const MAP_MARGIN_M: f64 = 0.5;
/// Spacing of the points that [`Navigation::snap`] tries.
const SNAP_PITCH_M: f64 = 0.025;

/// State of a grid point during a flood fill.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    Unknown,
    Blocked,
    Free,
    Reached,
}

/// Free space of one scene for one agent body: exact collision queries and shortest paths.
///
/// Building takes about a millisecond per house, so a changed scene gets a new one
/// ([`Navigation::with_scene`]). The visibility graph for paths is computed by the first searches
/// and reused.
#[derive(Debug)]
pub struct Navigation {
    agent: AgentBody,
    config: NavigationConfig,
    obstacles: Obstacles,
    /// Footprints of the floors' parts, and the boxes that decide most tests of them.
    floors: Vec<(Gist, Obstacle)>,
    min_m: Vec2,
    max_m: Vec2,
    graph: OnceLock<VisibilityGraph>,
}

impl Navigation {
    /// Build the free space of `scene` for an agent.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] if a length is not finite and positive, the agent's height less
    /// than twice its radius or the step not below its height; [`Error::Simulation`] if the scene
    /// has no floor or its geometry is not finite.
    pub fn build(scene: &Scene, agent: AgentBody, config: NavigationConfig) -> Result<Self, Error> {
        let is_length = |v: f64| v.is_finite() && v > 0.0;
        Error::require("radius_m", agent.radius_m, "finite and > 0", is_length)?;
        Error::require("height_m", agent.height_m, "finite and at least 2 radius_m", |v| {
            v.is_finite() && v >= 2.0 * agent.radius_m
        })?;
        Error::require("step_height_m", config.step_height_m, "0 or more, below height_m", |v| {
            (0.0..agent.height_m).contains(&v)
        })?;
        Error::require("tolerance_m", config.tolerance_m, "0 or more, below radius_m", |v| {
            (0.0..agent.radius_m).contains(&v)
        })?;
        Error::require("snap_m", config.snap_m, "between 0 and 10", |v| (0.0..=10.0).contains(&v))?;
        let thinner = AgentBody { radius_m: agent.radius_m - config.tolerance_m, ..agent };
        let obstacles = Obstacles::build(&scene.bodies, thinner, config.step_height_m)?;
        let floors = floors_of(scene)?;
        let [min_m, max_m] = extent_of(&floors);
        let floors = floors.into_iter().map(|floor| (floor.gist(), floor)).collect();
        Ok(Self { agent, config, obstacles, floors, min_m, max_m, graph: OnceLock::new() })
    }

    /// Build the free space of a changed scene for the same agent and settings.
    ///
    /// # Errors
    /// As [`Navigation::build`].
    pub fn with_scene(&self, scene: &Scene) -> Result<Self, Error> {
        Self::build(scene, self.agent, self.config)
    }

    /// Return the agent's body.
    pub fn agent(&self) -> AgentBody {
        self.agent
    }

    /// Return the obstacles of the agent.
    pub fn obstacles(&self) -> &Obstacles {
        &self.obstacles
    }

    /// Return whether the agent can stand at `[x, z]`: on a floor and in collision with nothing.
    pub fn is_free(&self, point_m: Vec2) -> bool {
        self.obstacles.is_clear(point_m) && self.is_indoors(point_m)
    }

    /// Return [`Self::is_free`] for one of several points near each other.
    fn is_free_after(&self, point_m: Vec2, blocker: &Cell<u32>) -> bool {
        self.obstacles.is_clear_after(point_m, blocker) && self.is_indoors(point_m)
    }

    /// Return whether the agent can move straight from one point to the other without its swept
    /// body touching anything.
    pub fn try_move(&self, from_m: Vec2, to_m: Vec2) -> bool {
        self.is_free(from_m) && self.is_free(to_m) && self.obstacles.is_clear_between(from_m, to_m)
    }

    /// Return the points of a square grid through `from_m` that can be reached by straight moves
    /// along the grid, as AI2-THOR's `GetReachablePositions`: 4-connected, each step swept with the
    /// body.
    ///
    /// # Returns
    /// Points `[x, z]` by ascending z, then x; empty if `from_m` is not free.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] if `grid_m` is not finite and at least 0.01.
    ///
    /// # Source
    /// `getReachablePositions` of AI2-THOR's `BaseFPSAgentController`.
    pub fn reachable_positions(&self, from_m: Vec2, grid_m: f64) -> Result<Vec<Vec2>, Error> {
        Error::require("grid_m", grid_m, "finite and at least 0.01", |v| {
            v.is_finite() && v >= 0.01
        })?;
        if !self.is_free(from_m) {
            return Ok(Vec::new());
        }
        // Points are computed by their offset from the start, so that a point has the same
        // coordinates whichever way leads to it.
        let point_of = |cell: [i64; 2]| [0, 1].map(|i| from_m[i] + cell[i] as f64 * grid_m);
        let cells_to = |bound_m: f64, i: usize| (bound_m - from_m[i]) / grid_m;
        let low = [0, 1].map(|i| cells_to(self.min_m[i] - FLOOR_SLACK_M, i).floor() - 1.0);
        let high = [0, 1].map(|i| cells_to(self.max_m[i] + FLOOR_SLACK_M, i).ceil() + 2.0);
        let size = [0, 1].map(|i| high[i] - low[i]);
        Error::require("grid points", size[0] * size[1], "at most 2^26", |n| {
            n <= MAX_CELLS as f64
        })?;
        let (low, cols) = (low.map(|bound| bound as i64), size[0] as usize);
        let index =
            |cell: [i64; 2]| (cell[1] - low[1]) as usize * cols + (cell[0] - low[0]) as usize;
        let cell_at =
            |index: usize| [(index % cols) as i64 + low[0], (index / cols) as i64 + low[1]];
        // Free points lie in the box of the floors grown by the slack, so their neighbours are on
        // the grid.
        let mut state = vec![State::Unknown; cols * size[1] as usize];
        state[index([0, 0])] = State::Reached;
        let (mut open, blocker) = (vec![[0_i64, 0]], Cell::new(NONE));
        while let Some(cell) = open.pop() {
            for step in [[1, 0], [0, 1], [-1, 0], [0, -1]] {
                let next = [cell[0] + step[0], cell[1] + step[1]];
                let (to_m, state) = (point_of(next), &mut state[index(next)]);
                if *state == State::Unknown {
                    let is_free = self.is_free_after(to_m, &blocker);
                    *state = if is_free { State::Free } else { State::Blocked };
                }
                if *state == State::Free && self.obstacles.is_clear_between(point_of(cell), to_m) {
                    *state = State::Reached;
                    open.push(next);
                }
            }
        }
        let reached = (0..state.len()).filter(|&index| state[index] == State::Reached);
        Ok(reached.map(|index| point_of(cell_at(index))).collect())
    }

    /// Return the nearest of `reachable_m` to a point, the first of equals; `None` if there is
    /// none.
    pub fn nearest_reachable(&self, point_m: Vec2, reachable_m: &[Vec2]) -> Option<Vec2> {
        reachable_m
            .iter()
            .copied()
            .min_by(|&a, &b| distance_2d_m(a, point_m).total_cmp(&distance_2d_m(b, point_m)))
    }

    /// Return the nearest free point within [`NavigationConfig::snap_m`], on a grid of 2.5 cm, or
    /// the point itself if it is free. The result may lie in a pocket from which no path leads out.
    pub fn snap(&self, point_m: Vec2) -> Option<Vec2> {
        if self.is_free(point_m) {
            return Some(point_m);
        }
        self.free_near(point_m).next()
    }

    /// Return the free points within [`NavigationConfig::snap_m`], 2.5 cm apart, nearest first.
    pub fn free_near(&self, point_m: Vec2) -> impl Iterator<Item = Vec2> + '_ {
        let reach = (self.config.snap_m / SNAP_PITCH_M).floor() as i64;
        let mut offsets: Vec<[i64; 2]> = (-reach..=reach)
            .flat_map(|x| (-reach..=reach).map(move |z| [x, z]))
            .filter(|[x, z]| x * x + z * z <= reach * reach)
            .collect();
        offsets.sort_unstable_by_key(|&[x, z]| (x * x + z * z, x, z));
        offsets
            .into_iter()
            .map(move |offset| [0, 1].map(|i| point_m[i] + offset[i] as f64 * SNAP_PITCH_M))
            .filter(|&candidate| self.is_free(candidate))
    }

    /// Return the shortest any-angle path of the agent's axis, with its whole body clear of
    /// everything.
    ///
    /// # Returns
    /// Corners of the path, including both ends (snapped); `None` if an end is too far from the
    /// free space or there is no path. The length differs from the exact shortest path's by at most
    /// 1.3% of its arcs around obstacles, and is the same in both directions up to rounding.
    pub fn shortest_path(&self, start_m: Vec2, target_m: Vec2) -> Option<Vec<Vec2>> {
        self.path_between(self.snap(start_m)?, self.snap(target_m)?)
    }

    /// Return the shortest path between two free points. Where one sees the other, no graph is
    /// needed, which a fresh house has not built yet.
    fn path_between(&self, start_m: Vec2, target_m: Vec2) -> Option<Vec<Vec2>> {
        if self.obstacles.is_clear_between(start_m, target_m) {
            return Some(vec![start_m, target_m]);
        }
        self.graph().shortest_path(&self.obstacles, start_m, target_m)
    }

    /// Return whether there is a path between two points, neither of which is snapped.
    pub fn is_connected(&self, a_m: Vec2, b_m: Vec2) -> bool {
        let is_path = || self.path_between(a_m, b_m).is_some();
        self.is_free(a_m) && self.is_free(b_m) && is_path()
    }

    /// Return the length of the shortest path to each target, infinite where there is none.
    pub fn distances_m(&self, start_m: Vec2, targets_m: &[Vec2]) -> Vec<f64> {
        let Some(start_m) = self.snap(start_m) else {
            return vec![f64::INFINITY; targets_m.len()];
        };
        let snapped: Vec<Option<Vec2>> = targets_m.iter().map(|&t| self.snap(t)).collect();
        self.graph().distances_m(&self.obstacles, start_m, &snapped)
    }

    /// Compute the shortest distances from a point (snapped) to everywhere, for
    /// [`Self::field_distance_m`]; `None` if the point is too far from the free space.
    pub fn field(&self, source_m: Vec2) -> Option<DistanceField> {
        let source_m = self.snap(source_m)?;
        Some(self.graph().field(&self.obstacles, source_m))
    }

    /// Return the length of the shortest path between a field's source and a point (snapped), as
    /// [`Self::distances_m`]; infinite if there is none.
    pub fn field_distance_m(&self, field: &DistanceField, point_m: Vec2) -> f64 {
        let to = |point_m| field.distance_m(&self.obstacles, point_m);
        self.snap(point_m).map_or(f64::INFINITY, to)
    }

    /// Return the grid over the whole house, as [`map_spec`].
    ///
    /// # Errors
    /// As [`GridSpec::covering`].
    pub fn map_spec(&self, cell_m: f64) -> Result<GridSpec, Error> {
        spec_around(self.min_m, self.max_m, cell_m)
    }

    /// Return the oracle occupancy, row-major: 0 for cells whose centres can be reached by straight
    /// moves along the grid from the free centre nearest to `start_m`, 1 for all others.
    ///
    /// The same centres are returned by AI2-THOR's `GetReachablePositions` on a grid through that
    /// centre, so both simulators give the same map. The map accounts for the agent's full
    /// collision volume, as the paper requires of its oracle map (Sec. C.2), and excludes floor
    /// that cannot be reached. In ProcTHOR houses at 0.1 m, straight moves along the grid miss 0.1%
    /// of the centres that shortest paths reach.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] as [`Navigation::reachable_positions`].
    pub fn occupancy(&self, spec: &GridSpec, start_m: Vec2) -> Result<Vec<u8>, Error> {
        let mut cells = vec![1; spec.len()];
        let Some(seed_m) = self.nearest_free_centre(spec, start_m) else { return Ok(cells) };
        let reached_m = self.reachable_positions(seed_m, spec.cell_m)?;
        for cell in reached_m.into_iter().filter_map(|point_m| spec.cell_of(point_m)) {
            cells[spec.index(cell)] = 0;
        }
        Ok(cells)
    }

    /// Return the nearest cell centre where the agent fits, within [`NavigationConfig::snap_m`];
    /// the first, row-major, of equally near ones.
    fn nearest_free_centre(&self, spec: &GridSpec, point_m: Vec2) -> Option<Vec2> {
        let squared_m2 = |p: Vec2| (p[0] - point_m[0]).powi(2) + (p[1] - point_m[1]).powi(2);
        let reach_m = self.config.snap_m;
        let range = |axis: usize, count: usize| {
            let cell_at = |m: f64| ((m - spec.corner_m[axis]) / spec.cell_m).max(0.0) as usize;
            cell_at(point_m[axis] - reach_m)
                ..cell_at(point_m[axis] + reach_m + spec.cell_m).min(count)
        };
        let cells = range(1, spec.rows).flat_map(|r| range(0, spec.cols).map(move |c| [r, c]));
        let mut centres_m: Vec<Vec2> = cells
            .map(|cell| spec.centre_m(cell))
            .filter(|&centre_m| squared_m2(centre_m) <= reach_m * reach_m)
            .collect();
        centres_m.sort_by(|&a, &b| squared_m2(a).total_cmp(&squared_m2(b)));
        centres_m.into_iter().find(|&centre_m| self.is_free(centre_m))
    }

    /// Return the smallest and largest corner of a box around the floors, grown by the slack.
    pub(crate) fn extent_m(&self) -> [Vec2; 2] {
        [self.min_m.map(|v| v - FLOOR_SLACK_M), self.max_m.map(|v| v + FLOOR_SLACK_M)]
    }

    /// Return the body that is used for collisions, which is thinner by the tolerance, and the step
    /// height.
    pub(crate) fn collision_body(&self) -> (AgentBody, f64) {
        let radius_m = self.agent.radius_m - self.config.tolerance_m;
        (AgentBody { radius_m, ..self.agent }, self.config.step_height_m)
    }

    /// Return whether a point is over a floor, up to a slack.
    pub(crate) fn is_indoors(&self, point_m: Vec2) -> bool {
        let is_over = |(gist, floor): &(Gist, Obstacle)| {
            gist.blocks(point_m).unwrap_or_else(|| floor.blocks(point_m))
        };
        self.floors.iter().any(is_over)
    }

    fn graph(&self) -> &VisibilityGraph {
        self.graph.get_or_init(|| {
            let blocker = Cell::new(NONE);
            let is_free = |point_m| self.is_free_after(point_m, &blocker);
            let may_be_free = |centre_m, half_m| {
                !self.obstacles.cover(centre_m, half_m, &blocker)
                    && !self.floors.iter().all(|(gist, _)| gist.is_apart_from(centre_m, half_m))
            };
            VisibilityGraph::build(&self.obstacles, is_free, may_be_free)
        })
    }
}

/// Return a grid over a whole house and its outer walls, aligned to multiples of `cell_m`. It is
/// the same for all stages of a task, since rooms do not change.
///
/// # Errors
/// As [`GridSpec::covering`]; [`Error::Simulation`] if the scene has no floor.
pub fn map_spec(scene: &Scene, cell_m: f64) -> Result<GridSpec, Error> {
    let [min_m, max_m] = extent_of(&floors_of(scene)?);
    spec_around(min_m, max_m, cell_m)
}

fn spec_around(min_m: Vec2, max_m: Vec2, cell_m: f64) -> Result<GridSpec, Error> {
    let [low_m, high_m] = [(min_m, -MAP_MARGIN_M), (max_m, MAP_MARGIN_M)]
        .map(|(bound_m, margin_m)| bound_m.map(|v| v + margin_m));
    GridSpec::covering(low_m, high_m, cell_m)
}

/// Return the smallest and largest corner of all outlines.
fn extent_of(floors: &[Obstacle]) -> [Vec2; 2] {
    bounds_2d_m(floors.iter().flat_map(|floor| floor.outline_m.iter().copied()))
}

/// Return the floors' parts as polygons that contain all points within the slack of them.
fn floors_of(scene: &Scene) -> Result<Vec<Obstacle>, Error> {
    let bodies = scene.bodies.iter().enumerate();
    let floors: Vec<Obstacle> = bodies
        .filter(|(_, body)| body.kind == BodyKind::Floor)
        .flat_map(|(index, body)| body.parts.iter().map(move |part| (index, part)))
        .filter_map(|(index, part)| Some((index, footprint(part, f64::MIN, f64::MAX)?)))
        .map(|(index, shadow)| Obstacle::new(shadow, FLOOR_SLACK_M, index))
        .collect();
    let mut numbers = floors.iter().flat_map(|floor| &floor.outline_m).flatten();
    if floors.is_empty() || !numbers.all(|v| v.is_finite()) {
        let message = "the house has no floor, or one that is not finite".to_owned();
        return Err(Error::Simulation { message });
    }
    Ok(floors)
}
