//! Reachability while furniture is moved: the rooms, objects, ways between rooms and the house's
//! own start that an agent can reach.
//!
//! Gives the same answers as [`Navigation::reachable_positions`].

use crate::{
    generation::{
        Parameters,
        placement::step_grid::{Blocked, StepGrid},
    },
    geometry::{Vec2, distance_2d_m},
    house::House,
    world::{layout::Layout, navigation::Navigation},
};

/// The rooms, objects and ways that can be reached from a point, updated as objects move.
pub struct Reach {
    grid: StepGrid,
    /// Points and steps that each object blocks now.
    blocked: Vec<Blocked>,
    is_reached: Vec<bool>,
    /// The reached points.
    queue: Vec<u32>,
    /// Nearest and farthest distance of a reference pose from its target.
    range_m: [f64; 2],
    rooms_of_objects: Vec<Option<usize>>,
    num_rooms: usize,
    before: Access,
}

/// The rooms, objects and ways that are reached.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
struct Access {
    rooms: Vec<bool>,
    objects: Vec<bool>,
    /// Pairs of a room's neighbours between which a way leads through the room, the same one twice
    /// for a way in: `[room, neighbour, neighbour]`, sorted.
    ways: Vec<[u32; 3]>,
    /// The house's own start, where simulators begin.
    house_start: bool,
}

impl Reach {
    /// Find what `layout` lets an agent reach from `start_m`.
    ///
    /// # Arguments
    /// * `navigation` - built from the layout's scene.
    ///
    /// # Returns
    /// `None` if the start is not free, the house too large, or its geometry not finite.
    pub fn new(
        house: &House,
        layout: &Layout,
        navigation: &Navigation,
        start_m: Vec2,
        parameters: &Parameters,
    ) -> Option<Self> {
        let mut grid = StepGrid::new(house, navigation, start_m)?;
        let mut blocked = vec![Blocked::default(); layout.items.len()];
        for (index, body) in layout.scene.bodies.iter().enumerate() {
            let object = index.checked_sub(layout.scene.first_object);
            let by_body = grid.blocked_by(body)?;
            grid.count(&by_body, true);
            if let Some(slot) = object.and_then(|object| blocked.get_mut(object)) {
                *slot = by_body;
            }
        }
        let mut reach = Self {
            is_reached: vec![false; grid.len()],
            grid,
            blocked,
            queue: Vec::new(),
            range_m: [parameters.reference_min_m, parameters.reference_max_m],
            rooms_of_objects: house.objects.iter().map(|object| object.room).collect(),
            num_rooms: house.rooms.len(),
            before: Access::default(),
        };
        reach.flood();
        reach.before = reach.access(layout);
        Some(reach)
    }

    /// Take in that objects have moved, and check that all that could be reached still
    /// can.
    ///
    /// Where it cannot, the objects must be put back and taken in again.
    pub fn still_reaches(&mut self, layout: &Layout, moved: impl Iterator<Item = usize>) -> bool {
        if !self.take_in(layout, moved) {
            return false;
        }
        self.flood();
        self.access(layout).includes(&self.before)
    }

    /// Take in that objects have moved; return false if the geometry of one is not finite.
    pub fn take_in(&mut self, layout: &Layout, moved: impl Iterator<Item = usize>) -> bool {
        for index in moved {
            let Some(body) = layout.scene.bodies.get(layout.scene.first_object + index) else {
                continue;
            };
            let Some(blocked) = self.grid.blocked_by(body) else { return false };
            self.grid.count(&self.blocked[index], false);
            self.grid.count(&blocked, true);
            self.blocked[index] = blocked;
        }
        true
    }

    /// Find the points that can be reached.
    fn flood(&mut self) {
        self.is_reached.fill(false);
        let mut queue = std::mem::take(&mut self.queue);
        queue.clear();
        if self.grid.is_open(self.grid.start) {
            self.is_reached[self.grid.start] = true;
            queue.push(self.grid.start as u32);
        }
        let mut next = 0;
        while let Some(&point) = queue.get(next) {
            next += 1;
            for to in self.grid.steps(point as usize) {
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
            if let Some(is_reached) = rooms.get_mut(self.grid.room[point as usize] as usize) {
                *is_reached = true;
            }
        }
        Access {
            rooms,
            objects: (0..layout.items.len()).map(|index| self.is_near(layout, index)).collect(),
            ways: self.ways(),
            house_start: self.grid.is_house_start_reached(&self.is_reached),
        }
    }

    /// Return whether a reached point of an object's room lies at the reference distance from it.
    fn is_near(&self, layout: &Layout, index: usize) -> bool {
        let Some(room) = self.rooms_of_objects.get(index).copied().flatten() else { return false };
        let [x, _, z] = layout.items[index].placement.position_m;
        let [near_m, far_m] = self.range_m;
        self.grid.points_around([x - far_m, z - far_m], [x + far_m, z + far_m]).any(|point| {
            self.is_reached[point]
                && self.grid.room[point] as usize == room
                && (near_m..=far_m).contains(&distance_2d_m(self.grid.point_m(point), [x, z]))
        })
    }

    /// Return the ways through rooms, between the rooms next to them.
    fn ways(&self) -> Vec<[u32; 3]> {
        let room = &self.grid.room;
        // Parts of rooms: the reached points that steps within a room connect.
        let mut part = vec![0_u32; room.len()];
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
                for to in self.grid.steps(point) {
                    if room[to] != room[point] {
                        doors.push([room[point], num_parts, room[to]]);
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
    /// Return whether all that `before` reaches is reached.
    fn includes(&self, before: &Self) -> bool {
        let covers = |now: &[bool], then: &[bool]| now.iter().zip(then).all(|(n, t)| *n || !*t);
        covers(&self.rooms, &before.rooms)
            && covers(&self.objects, &before.objects)
            && (self.house_start || !before.house_start)
            && before.ways.iter().all(|way| self.ways.binary_search(way).is_ok())
    }
}
