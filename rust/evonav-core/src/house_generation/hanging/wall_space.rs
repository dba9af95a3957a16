//! The stretches of a room's walls that are still free.

use crate::{
    house_generation::{
        rectangle::Rectangle,
        structure::{PlannedRoom, Side},
    },
    rng::Stream,
};

/// Length added around what is on a wall, for rounding (`POLYGON_PADDING`).
const PADDING_M: f64 = 1e-3;

/// A free stretch of a side of a room.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Stretch {
    /// Index in the room's sides.
    pub side: usize,
    /// Its start and end, from the side's first end.
    pub along_m: [f64; 2],
}

impl Stretch {
    pub fn length_m(&self) -> f64 {
        self.along_m[1] - self.along_m[0]
    }
}

/// The free walls of a room.
#[derive(Debug, Clone)]
pub(super) struct WallSpace<'a> {
    room: &'a PlannedRoom,
    pub stretches: Vec<Stretch>,
}

impl<'a> WallSpace<'a> {
    /// Create the free walls of a room: those sides, by index, for which `is_wall`.
    pub fn new(room: &'a PlannedRoom, is_wall: impl Fn(usize, &Side) -> bool) -> Self {
        let walls = room.sides.iter().enumerate().filter(|(index, side)| is_wall(*index, side));
        let whole = |(index, side): (usize, &Side)| {
            let length_m = crate::geometry::distance_2d_m(side.from_m, side.to_m);
            Stretch { side: index, along_m: [0.0, length_m] }
        };
        Self { room, stretches: walls.map(whole).collect() }
    }

    /// Take a stretch of a side away.
    pub fn take(&mut self, side: usize, [from, to]: [f64; 2]) {
        let taken = [from - PADDING_M, to + PADDING_M];
        let rest = |stretch: Stretch| {
            let [low, high] = stretch.along_m;
            let parts = match stretch.side == side && taken[0] < high && low < taken[1] {
                true => [[low, taken[0]], [taken[1], high]],
                false => [[low, high], [0.0, 0.0]],
            };
            parts.map(|along_m| Stretch { side: stretch.side, along_m })
        };
        let left = self.stretches.iter().flat_map(|&stretch| rest(stretch));
        self.stretches = left.filter(|stretch| stretch.length_m() > PADDING_M).collect();
    }

    /// Take away all walls that a rectangle on the floor reaches.
    pub fn take_behind(&mut self, rectangle: &Rectangle) {
        for index in 0..self.room.sides.len() {
            if let Some(along_m) = reach_along(&self.room.sides[index], rectangle) {
                self.take(index, along_m);
            }
        }
    }

    /// Draw a stretch longer than `least_m`, in proportion to their lengths.
    pub fn sample(&self, least_m: f64, stream: &mut Stream) -> Option<Stretch> {
        let lengths = self.stretches.iter().map(Stretch::length_m);
        let weights: Vec<f64> = lengths.map(|m| if m > least_m { m } else { 0.0 }).collect();
        stream.choose_weighted(&weights).map(|index| self.stretches[index])
    }
}

/// Return the stretch of a side that a rectangle on the floor reaches, beyond its ends too; `None`
/// if it does not.
pub(super) fn reach_along(side: &Side, rectangle: &Rectangle) -> Option<[f64; 2]> {
    let along = side.along();
    let axis = usize::from(along[0].abs() < 0.5);
    let across = 1 - axis;
    let line_m = side.from_m[across];
    let touches = rectangle.low_m[across] - PADDING_M <= line_m
        && line_m <= rectangle.high_m[across] + PADDING_M;
    let ends = [rectangle.low_m[axis], rectangle.high_m[axis]]
        .map(|value| (value - side.from_m[axis]) * along[axis]);
    touches.then(|| [ends[0].min(ends[1]), ends[0].max(ends[1])])
}
