//! Which rooms, objects, passages and the house's own start an agent can reach while furniture is moved about.
//!
//! The same grid, the same obstacles and the same answers as [`Navigation::reachable_positions`],
//! kept as counts per grid point and per step, so that a moved object costs the points around it
//! and not the house.

use crate::{
    generation::Parameters,
    geometry::{Vec2, distance_2d_m},
    house::House,
    world::{
        layout::Layout,
        navigation::{
            AgentBody, Navigation, Obstacle,
            obstacle::{Sweep, obstacles_of},
        },
        scene::{Body, BodyKind},
    },
};

/// AI2-THOR's grid of reachable positions.
pub const GRID_M: f64 = 0.25;
/// Most points of a grid; a house of a square kilometre has fewer in reach.
const MAX_POINTS: f64 = 4e6;

/// Grid points and steps that something blocks.
#[derive(Debug, Clone, Default)]
struct Marks {
    points: Vec<u32>,
    /// Steps by their first point: to the next point along x, and along z; then links of the pin.
    steps: [Vec<u32>; 3],
}

/// What can be reached from a point, kept up to date.
pub struct Reach {
    agent: AgentBody,
    step_height_m: f64,
    start: usize,
    /// Points along x and z.
    shape: [usize; 2],
    corner_m: Vec2,
    start_m: Vec2,
    start_cell: [i64; 2],
    /// Room of each point; `NOWHERE` off the floor.
    room: Vec<u32>,
    /// Things that block a point.
    point_blocks: Vec<u16>,
    /// Things that block a step, and neither of its ends.
    step_blocks: [Vec<u16>; 3],
    /// The house's own start, a point of no grid, and the points that it has a straight way to.
    pin_m: Option<Vec2>,
    links: Vec<u32>,
    /// Per object that has been moved, what it blocks now.
    marks: Vec<Option<Marks>>,
    is_reached: Vec<bool>,
    queue: Vec<u32>,
    range_m: [f64; 2],
    rooms_of_objects: Vec<Option<usize>>,
    num_rooms: usize,
    before: Option<Access>,
}

/// What is reached.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Access {
    rooms: Vec<bool>,
    objects: Vec<bool>,
    /// Pairs of a room's neighbours between which a way leads through the room, the same one twice
    /// for a way in: `[room, neighbour, neighbour]`, sorted.
    ways: Vec<[u32; 3]>,
    /// The house's own start, where simulators begin.
    start: bool,
}

/// Points of the grid this near to the house's start are linked to it.
const LINK_M: f64 = 0.36;
/// No floor.
const NOWHERE: u32 = u32::MAX;
/// Floor of no room: under a door.
const NO_ROOM: u32 = u32::MAX - 1;

impl Reach {
    /// What `layout` lets an agent reach from `start_m`; `None` if the start is not free, or the
    /// grid too large.
    ///
    /// # Arguments
    /// * `navigation` - built from the layout's scene.
    pub fn new(
        house: &House,
        layout: &Layout,
        navigation: &Navigation,
        start_m: Vec2,
        parameters: &Parameters,
    ) -> Option<Self> {
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
        let (agent, step_height_m) = navigation.thinner();
        let mut reach = Self {
            agent,
            step_height_m,
            start: start_cell[1] as usize * shape[0] + start_cell[0] as usize,
            shape,
            corner_m: [0, 1].map(|i| start_m[i] + first[i] * GRID_M),
            start_m,
            start_cell,
            room: vec![NOWHERE; count],
            // The pin comes after all others.
            point_blocks: vec![0; count + 1],
            step_blocks: [vec![0; count], vec![0; count], Vec::new()],
            pin_m: house.start.and_then(|s| navigation.snap([s.position_m[0], s.position_m[2]])),
            links: Vec::new(),
            marks: vec![None; layout.items.len()],
            is_reached: vec![false; count],
            queue: Vec::new(),
            range_m: [parameters.reference_min_m, parameters.reference_max_m],
            rooms_of_objects: house.objects.iter().map(|object| object.room).collect(),
            num_rooms: house.rooms.len(),
            before: None,
        };
        for point in 0..count {
            let at_m = reach.point_m(point);
            if navigation.is_indoors(at_m) {
                reach.room[point] = house.room_of(at_m).map_or(NO_ROOM, |room| room as u32);
            }
        }
        reach.links = reach.points_near_pin();
        reach.step_blocks[2] = vec![0; reach.links.len()];
        for (index, body) in layout.scene.bodies.iter().enumerate() {
            let object = index.checked_sub(layout.scene.first_object);
            let marks = reach.marks_of(body)?;
            reach.count(&marks, true);
            if let Some(slot) = object.and_then(|object| reach.marks.get_mut(object)) {
                *slot = Some(marks);
            }
        }
        reach.flood();
        reach.before = Some(reach.access(layout));
        Some(reach)
    }

    /// The same offsets from the start as `reachable_positions` takes, so the same numbers.
    fn point_m(&self, point: usize) -> Vec2 {
        let cell = [point % self.shape[0], point / self.shape[0]];
        [0, 1].map(|i| self.start_m[i] + (cell[i] as i64 - self.start_cell[i]) as f64 * GRID_M)
    }

    /// Points of the grid about the pin: at least those of the square that it is in.
    fn points_near_pin(&self) -> Vec<u32> {
        let Some(pin_m) = self.pin_m else { return Vec::new() };
        let is_near = |&point: &usize| {
            self.room[point] != NOWHERE && distance_2d_m(self.point_m(point), pin_m) < LINK_M
        };
        (0..self.room.len()).filter(is_near).map(|point| point as u32).collect()
    }

    /// What a body blocks; `None` if its geometry is not finite.
    fn marks_of(&self, body: &Body) -> Option<Marks> {
        let mut marks = Marks::default();
        if matches!(body.kind, BodyKind::Floor | BodyKind::Ceiling) {
            return Some(marks);
        }
        for obstacle in obstacles_of(body, 0, self.agent, self.step_height_m).ok()? {
            self.mark(&obstacle, &mut marks);
        }
        Some(marks)
    }

    fn mark(&self, obstacle: &Obstacle, marks: &mut Marks) {
        let [low_m, high_m] = obstacle.extent_m();
        let is_far = |pin_m: &Vec2| {
            [0, 1].iter().any(|&i| pin_m[i] < low_m[i] - LINK_M || high_m[i] + LINK_M < pin_m[i])
        };
        match self.pin_m.filter(|pin_m| !is_far(pin_m)) {
            Some(pin_m) if obstacle.blocks(pin_m) => marks.points.push(self.room.len() as u32),
            Some(pin_m) => {
                for (link, &point) in self.links.iter().enumerate() {
                    let sweep = Sweep::new(pin_m, self.point_m(point as usize));
                    if obstacle.blocks_sweep(&sweep) {
                        marks.steps[2].push(link as u32);
                    }
                }
            }
            None => {}
        }
        let cell = |value_m: f64, axis: usize, slack: f64| {
            let cell = (value_m - self.corner_m[axis]) / GRID_M + slack;
            cell.clamp(0.0, self.shape[axis] as f64) as usize
        };
        // One more point to the left, whose step leads in.
        let [x_low, z_low] = [cell(low_m[0], 0, -1.0), cell(low_m[1], 1, -1.0)];
        let [x_high, z_high] = [cell(high_m[0], 0, 2.0), cell(high_m[1], 1, 2.0)];
        for z in z_low..z_high {
            for x in x_low..x_high {
                let point = z * self.shape[0] + x;
                if self.room[point] == NOWHERE {
                    continue;
                }
                let at_m = self.point_m(point);
                if obstacle.blocks(at_m) {
                    marks.points.push(point as u32);
                    continue;
                }
                for (axis, stride) in [(0, 1), (1, self.shape[0])] {
                    let Some(&room) = self.room.get(point + stride) else { continue };
                    if room == NOWHERE {
                        continue;
                    }
                    let to_m = self.point_m(point + stride);
                    if obstacle.blocks_sweep(&Sweep::new(at_m, to_m)) {
                        marks.steps[axis].push(point as u32);
                    }
                }
            }
        }
    }

    /// Adds what something blocks, or takes it off.
    fn count(&mut self, marks: &Marks, is_added: bool) {
        let change = |count: &mut u16| {
            *count = if is_added { count.saturating_add(1) } else { count.saturating_sub(1) };
        };
        for &point in &marks.points {
            change(&mut self.point_blocks[point as usize]);
        }
        for axis in 0..3 {
            for &step in &marks.steps[axis] {
                change(&mut self.step_blocks[axis][step as usize]);
            }
        }
    }

    /// Takes in that objects have moved, and tells whether all that could be reached still can.
    ///
    /// Where not, the objects must be put back and taken in again.
    pub fn still_reaches(&mut self, layout: &Layout, moved: impl Iterator<Item = usize>) -> bool {
        if !self.take_in(layout, moved) {
            return false;
        }
        self.flood();
        let now = self.access(layout);
        self.before.as_ref().is_some_and(|before| now.includes(before))
    }

    /// Takes in that objects have moved; false if one's geometry is not finite.
    pub fn take_in(&mut self, layout: &Layout, moved: impl Iterator<Item = usize>) -> bool {
        for index in moved {
            let Some(body) = layout.scene.bodies.get(layout.scene.first_object + index) else {
                continue;
            };
            let Some(marks) = self.marks_of(body) else { return false };
            if let Some(old) = self.marks[index].take() {
                self.count(&old, false);
            }
            self.count(&marks, true);
            self.marks[index] = Some(marks);
        }
        true
    }

    /// Whether a step from a point of the grid along an axis is clear.
    fn is_step(&self, from: usize, axis: usize) -> bool {
        let to = from + if axis == 0 { 1 } else { self.shape[0] };
        self.step_blocks[axis][from] == 0 && self.is_open(from) && self.is_open(to)
    }

    fn is_open(&self, point: usize) -> bool {
        self.room[point] != NOWHERE && self.point_blocks[point] == 0
    }

    /// Points from which and to which steps are clear.
    fn steps(&self, point: usize) -> impl Iterator<Item = usize> {
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

    /// Finds what can be reached.
    fn flood(&mut self) {
        self.is_reached.fill(false);
        let mut queue = std::mem::take(&mut self.queue);
        queue.clear();
        if self.is_open(self.start) {
            self.is_reached[self.start] = true;
            queue.push(self.start as u32);
        }
        let mut next = 0;
        while let Some(&point) = queue.get(next) {
            next += 1;
            let steps: [Option<usize>; 4] = {
                let mut steps = self.steps(point as usize);
                std::array::from_fn(|_| steps.next())
            };
            for to in steps.into_iter().flatten() {
                if !self.is_reached[to] {
                    self.is_reached[to] = true;
                    queue.push(to as u32);
                }
            }
        }
        self.queue = queue;
    }

    fn access(&self, layout: &Layout) -> Access {
        let mut rooms = vec![false; self.num_rooms];
        for &point in &self.queue {
            if let Some(is_reached) = rooms.get_mut(self.room[point as usize] as usize) {
                *is_reached = true;
            }
        }
        let objects = (0..layout.items.len()).map(|index| self.is_near(layout, index)).collect();
        Access { rooms, objects, ways: self.ways(), start: self.is_pin_reached() }
    }

    fn is_pin_reached(&self) -> bool {
        let mut links = self.links.iter().zip(&self.step_blocks[2]);
        self.point_blocks.last() == Some(&0)
            && links.any(|(&point, &blocks)| blocks == 0 && self.is_reached[point as usize])
    }

    /// Whether a reached point of an object's room lies at the reference distance from it.
    fn is_near(&self, layout: &Layout, index: usize) -> bool {
        let Some(room) = self.rooms_of_objects.get(index).copied().flatten() else { return false };
        let [x, _, z] = layout.items[index].placement.position_m;
        let [near_m, far_m] = self.range_m;
        let cell = |value_m: f64, axis: usize, slack: f64| {
            let cell = (value_m - self.corner_m[axis]) / GRID_M + slack;
            cell.clamp(0.0, self.shape[axis] as f64) as usize
        };
        let [x_low, z_low] = [cell(x - far_m, 0, -1.0), cell(z - far_m, 1, -1.0)];
        let [x_high, z_high] = [cell(x + far_m, 0, 2.0), cell(z + far_m, 1, 2.0)];
        (z_low..z_high).any(|row| {
            (x_low..x_high).any(|column| {
                let point = row * self.shape[0] + column;
                self.is_reached[point]
                    && self.room[point] as usize == room
                    && (near_m..=far_m).contains(&distance_2d_m(self.point_m(point), [x, z]))
            })
        })
    }

    /// Ways through rooms, between the rooms next to them.
    fn ways(&self) -> Vec<[u32; 3]> {
        // Parts of rooms: the reached points that steps within a room connect.
        let mut part = vec![0_u32; self.room.len()];
        let mut num_parts = 0;
        let mut doors: Vec<[u32; 3]> = Vec::new();
        let mut stack = Vec::new();
        for &seed in &self.queue {
            if part[seed as usize] != 0 {
                continue;
            }
            num_parts += 1;
            part[seed as usize] = num_parts;
            stack.push(seed as usize);
            while let Some(point) = stack.pop() {
                for to in self.steps(point) {
                    if self.room[to] != self.room[point] {
                        doors.push([self.room[point], num_parts, self.room[to]]);
                    } else if part[to] == 0 {
                        part[to] = num_parts;
                        stack.push(to);
                    }
                }
            }
        }
        doors.sort_unstable();
        doors.dedup();
        let mut ways: Vec<[u32; 3]> = doors
            .chunk_by(|a, b| a[..2] == b[..2])
            .flat_map(|of_part| {
                of_part.iter().flat_map(move |a| of_part.iter().map(move |b| [a[0], a[2], b[2]]))
            })
            .collect();
        ways.sort_unstable();
        ways.dedup();
        ways
    }
}

impl Access {
    /// Whether all that `before` reaches is reached.
    fn includes(&self, before: &Self) -> bool {
        let covers = |now: &[bool], then: &[bool]| now.iter().zip(then).all(|(n, t)| *n || !*t);
        covers(&self.rooms, &before.rooms)
            && covers(&self.objects, &before.objects)
            && (self.start || !before.start)
            && before.ways.iter().all(|way| self.ways.binary_search(way).is_ok())
    }
}
