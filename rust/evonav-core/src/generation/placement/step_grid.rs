//! A grid of points and of the straight steps between them, with counts of what blocks each.
//!
//! The points are those of [`Navigation::reachable_positions`] from the same start. Counting what
//! blocks a point makes moving an object cost the points around it instead of the whole house.

use std::ops::Range;

use crate::{
    geometry::{Vec2, distance_2d_m},
    house::House,
    world::{
        navigation::{
            AgentBody, Navigation, Obstacle,
            obstacle::{Sweep, obstacles_of},
        },
        scene::{Body, BodyKind},
    },
};

/// Spacing of AI2-THOR's grid of reachable positions.
pub const GRID_M: f64 = 0.25;
/// Room number of points off the floor.
pub const NOWHERE: u32 = u32::MAX;
/// Room number of floor that belongs to no room: under a door.
const NO_ROOM: u32 = u32::MAX - 1;
/// Largest number of points; a house of a square kilometre has fewer in reach.
const MAX_POINTS: f64 = 4e6;
/// Points of the grid this near to the house's own start are linked to it.
const LINK_M: f64 = 0.36;

/// Points and steps that one body blocks.
#[derive(Debug, Clone, Default)]
pub struct Blocked {
    points: Vec<u32>,
    /// Steps by their first point: to the next point along x, and along z; then links of the house's
    /// own start.
    steps: [Vec<u32>; 3],
}

/// Points around an agent's start, the room of each, and what blocks points and steps.
pub struct StepGrid {
    agent: AgentBody,
    step_height_m: f64,
    /// Index of the point where the agent starts.
    pub start: usize,
    /// Number of points along x and z.
    shape: [usize; 2],
    corner_m: Vec2,
    start_m: Vec2,
    start_cell: [i64; 2],
    /// Index of each point's room; [`NOWHERE`] off the floor.
    pub room: Vec<u32>,
    /// Number of bodies that block each point; the house's own start comes last.
    point_blocks: Vec<u16>,
    /// Number of bodies that block each step and neither of its ends.
    step_blocks: [Vec<u16>; 3],
    /// The house's own start, which is not a point of the grid.
    house_start_m: Option<Vec2>,
    /// Points to which the house's own start is linked.
    links: Vec<u32>,
}

impl StepGrid {
    /// Lay a grid over the house through `start_m`, with nothing on it yet.
    ///
    /// # Returns
    /// `None` if the start is not free, or the grid too large.
    pub fn new(house: &House, navigation: &Navigation, start_m: Vec2) -> Option<Self> {
        let [low_m, high_m] = navigation.extent_m();
        // A margin of one point, so that the neighbours of a point on the floor are on the grid.
        let first = [0, 1].map(|i| ((low_m[i] - start_m[i]) / GRID_M).floor() - 1.0);
        let size = [0, 1].map(|i| ((high_m[i] - start_m[i]) / GRID_M).ceil() + 2.0 - first[i]);
        let is_sound = size.iter().all(|v| *v >= 1.0) && size[0] * size[1] <= MAX_POINTS;
        if !is_sound || !navigation.is_free(start_m) {
            return None;
        }
        let shape = size.map(|v| v as usize);
        let start_cell = first.map(|v| -v as i64);
        let count = shape[0] * shape[1];
        let (agent, step_height_m) = navigation.collision_body();
        let mut grid = Self {
            agent,
            step_height_m,
            start: start_cell[1] as usize * shape[0] + start_cell[0] as usize,
            shape,
            corner_m: [0, 1].map(|i| start_m[i] + first[i] * GRID_M),
            start_m,
            start_cell,
            room: vec![NOWHERE; count],
            point_blocks: vec![0; count + 1],
            step_blocks: [vec![0; count], vec![0; count], Vec::new()],
            house_start_m: house
                .start
                .and_then(|s| navigation.snap([s.position_m[0], s.position_m[2]])),
            links: Vec::new(),
        };
        for point in 0..count {
            let at_m = grid.point_m(point);
            if navigation.is_indoors(at_m) {
                grid.room[point] = house.room_of(at_m).map_or(NO_ROOM, |room| room as u32);
            }
        }
        grid.links = grid.points_near_house_start();
        grid.step_blocks[2] = vec![0; grid.links.len()];
        Some(grid)
    }

    /// Return the number of points.
    pub fn len(&self) -> usize {
        self.room.len()
    }

    /// Return `[x, z]` of a point, computed from the start as `reachable_positions` does, so that
    /// both give the same numbers.
    pub fn point_m(&self, point: usize) -> Vec2 {
        let cell = [point % self.shape[0], point / self.shape[0]];
        [0, 1].map(|i| self.start_m[i] + (cell[i] as i64 - self.start_cell[i]) as f64 * GRID_M)
    }

    /// Return the points of a rectangle and a margin of one point around it, row by row.
    pub fn points_around(&self, low_m: Vec2, high_m: Vec2) -> impl Iterator<Item = usize> + use<> {
        let row = self.shape[0];
        let [columns, rows] = [0, 1].map(|axis| self.span(axis, low_m[axis], high_m[axis]));
        rows.flat_map(move |z| columns.clone().map(move |x| z * row + x))
    }

    fn span(&self, axis: usize, low_m: f64, high_m: f64) -> Range<usize> {
        let cell = |value_m: f64, slack: f64| {
            let cell = (value_m - self.corner_m[axis]) / GRID_M + slack;
            cell.clamp(0.0, self.shape[axis] as f64) as usize
        };
        // One more point before the rectangle: its step leads in.
        cell(low_m, -1.0)..cell(high_m, 2.0)
    }

    /// Return the points around the house's own start: at least those of the square that holds it.
    fn points_near_house_start(&self) -> Vec<u32> {
        let Some(start_m) = self.house_start_m else { return Vec::new() };
        let is_near = |&point: &usize| {
            self.room[point] != NOWHERE && distance_2d_m(self.point_m(point), start_m) < LINK_M
        };
        (0..self.room.len()).filter(is_near).map(|point| point as u32).collect()
    }

    /// Return what a body blocks; `None` if its geometry is not finite.
    pub fn blocked_by(&self, body: &Body) -> Option<Blocked> {
        let mut blocked = Blocked::default();
        if matches!(body.kind, BodyKind::Floor | BodyKind::Ceiling) {
            return Some(blocked);
        }
        for obstacle in obstacles_of(body, 0, self.agent, self.step_height_m).ok()? {
            self.block_house_start(&obstacle, &mut blocked);
            self.block_points(&obstacle, &mut blocked);
        }
        Some(blocked)
    }

    fn block_house_start(&self, obstacle: &Obstacle, blocked: &mut Blocked) {
        let [low_m, high_m] = obstacle.extent_m();
        let is_far = |start_m: &Vec2| {
            [0, 1]
                .iter()
                .any(|&i| start_m[i] < low_m[i] - LINK_M || high_m[i] + LINK_M < start_m[i])
        };
        match self.house_start_m.filter(|start_m| !is_far(start_m)) {
            Some(start_m) if obstacle.blocks(start_m) => {
                blocked.points.push(self.room.len() as u32);
            }
            Some(start_m) => {
                for (link, &point) in self.links.iter().enumerate() {
                    let sweep = Sweep::new(start_m, self.point_m(point as usize));
                    if obstacle.blocks_sweep(&sweep) {
                        blocked.steps[2].push(link as u32);
                    }
                }
            }
            None => {}
        }
    }

    fn block_points(&self, obstacle: &Obstacle, blocked: &mut Blocked) {
        let [low_m, high_m] = obstacle.extent_m();
        for point in self.points_around(low_m, high_m) {
            if self.room[point] == NOWHERE {
                continue;
            }
            let at_m = self.point_m(point);
            if obstacle.blocks(at_m) {
                blocked.points.push(point as u32);
                continue;
            }
            for (axis, stride) in [(0, 1), (1, self.shape[0])] {
                let Some(&room) = self.room.get(point + stride) else { continue };
                if room == NOWHERE {
                    continue;
                }
                let to_m = self.point_m(point + stride);
                if obstacle.blocks_sweep(&Sweep::new(at_m, to_m)) {
                    blocked.steps[axis].push(point as u32);
                }
            }
        }
    }

    /// Count what a body blocks once more, or once less if `is_added` is false.
    pub fn count(&mut self, blocked: &Blocked, is_added: bool) {
        let change = |count: &mut u16| {
            *count = if is_added { count.saturating_add(1) } else { count.saturating_sub(1) };
        };
        for &point in &blocked.points {
            change(&mut self.point_blocks[point as usize]);
        }
        for axis in 0..3 {
            for &step in &blocked.steps[axis] {
                change(&mut self.step_blocks[axis][step as usize]);
            }
        }
    }

    /// Return whether nothing blocks a point of the floor.
    pub fn is_open(&self, point: usize) -> bool {
        self.room[point] != NOWHERE && self.point_blocks[point] == 0
    }

    /// Return whether the step from a point to the next along an axis is clear.
    fn is_step(&self, from: usize, axis: usize) -> bool {
        let to = from + if axis == 0 { 1 } else { self.shape[0] };
        self.step_blocks[axis][from] == 0 && self.is_open(from) && self.is_open(to)
    }

    /// Return the points to which a clear step leads.
    pub fn steps(&self, point: usize) -> impl Iterator<Item = usize> {
        let row = self.shape[0];
        [
            (point + 1, point, 0),
            (point + row, point, 1),
            (point.wrapping_sub(1), point.wrapping_sub(1), 0),
            (point.wrapping_sub(row), point.wrapping_sub(row), 1),
        ]
        .into_iter()
        .filter(|&(to, from, axis)| {
            to < self.room.len() && from < self.room.len() && self.is_step(from, axis)
        })
        .map(|(to, _, _)| to)
    }

    /// Return whether a clear link leads from a reached point to the house's own start.
    pub fn is_house_start_reached(&self, is_reached: &[bool]) -> bool {
        let mut links = self.links.iter().zip(&self.step_blocks[2]);
        self.point_blocks.last() == Some(&0)
            && links.any(|(&point, &blocks)| blocks == 0 && is_reached[point as usize])
    }
}
