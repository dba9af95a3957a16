//! One obstacle: a convex polygon on the ground plane and the distance to keep from it.

use std::cell::OnceCell;

use crate::{
    Error,
    geometry::{Vec2, bounds_2d_m, outline::distance_squared},
    world::{
        footprint::{Footprint, footprint},
        navigation::AgentBody,
        scene::Body,
    },
};

/// Largest distance of the tangents that replace an obstacle's rounded corner from the outline's
/// corner, in radii ([`crate::world::navigation::visibility_graph`]).
const HUG: f64 = 1.02;
/// Part of the distance to keep by which diagonals are longer than those of the outline.
const STRETCH: f64 = 0.99;
/// Margin of tests by boxes, far above rounding: a metre of a move adds another.
const HAIR_M: f64 = 1e-9;

/// A convex polygon that the agent's axis must keep `radius_m` away from.
#[derive(Debug, Clone, PartialEq)]
pub struct Obstacle {
    /// Convex outline, interior on the left; one or two points if degenerate.
    pub outline_m: Vec<Vec2>,
    /// Distance to keep.
    pub radius_m: f64,
    /// Index of its body in the scene.
    pub body: usize,
    /// Smallest corner of a box slightly larger than the grown outline.
    pub(super) min_m: Vec2,
    /// Largest corner of that box.
    pub(super) max_m: Vec2,
}

/// Return the obstacles of the parts of one body, without those that another of them covers.
///
/// # Errors
/// [`Error::Simulation`] naming the body if a part's geometry is not finite.
pub(crate) fn obstacles_of(
    body: &Body,
    index: usize,
    agent: AgentBody,
    step_height_m: f64,
) -> Result<Vec<Obstacle>, Error> {
    let mut obstacles = Vec::with_capacity(body.parts.len());
    for part in &body.parts {
        let Some(shadow) = footprint(part, step_height_m, agent.height_m) else { continue };
        if !shadow.outline_m.iter().flatten().all(|v| v.is_finite()) {
            let message = format!("{}: a part of its shape is not finite", body.id);
            return Err(Error::Simulation { message });
        }
        let radius_m = agent.radius_between_m(shadow.bottom_m, shadow.top_m);
        obstacles.push(Obstacle::new(shadow, radius_m, index));
    }
    drop_covered(&mut obstacles);
    Ok(obstacles)
}

fn drop_covered(obstacles: &mut Vec<Obstacle>) {
    let mut i = 0;
    while i < obstacles.len() {
        let is_covered = (0..obstacles.len()).any(|j| j != i && obstacles[j].covers(&obstacles[i]));
        if is_covered {
            obstacles.remove(i);
        } else {
            i += 1;
        }
    }
}

/// A straight move of a point.
pub(crate) struct Sweep {
    a: Vec2,
    b: Vec2,
    /// The vector from `a` to `b`.
    leg_m: Vec2,
    /// Its length, up to rounding.
    length_m: f64,
    /// Smallest and largest corner of the box of both ends.
    extent_m: [Vec2; 2],
    frame: OnceCell<Frame>,
}

/// The length of a move, and its direction: any unit vector if it has no length.
#[derive(Debug, Clone, Copy)]
struct Frame {
    length_m: f64,
    along: Vec2,
}

impl Sweep {
    /// Create the move from `a` to `b`.
    pub(crate) fn new(a: Vec2, b: Vec2) -> Self {
        let leg_m = [b[0] - a[0], b[1] - a[1]];
        let extent_m = [[a[0].min(b[0]), a[1].min(b[1])], [a[0].max(b[0]), a[1].max(b[1])]];
        let length_m = (leg_m[0] * leg_m[0] + leg_m[1] * leg_m[1]).sqrt();
        Self { a, b, leg_m, length_m, extent_m, frame: OnceCell::new() }
    }

    /// Return length and direction, which only few tests need.
    fn frame(&self) -> Frame {
        *self.frame.get_or_init(|| {
            let length_m = self.leg_m[0].hypot(self.leg_m[1]);
            let along = self.leg_m.map(|v| v / length_m);
            Frame { length_m, along: if length_m > 0.0 { along } else { [1.0, 0.0] } }
        })
    }

    /// Return whether this move surely crosses the segment from `p` to `q`.
    fn crosses(&self, [p, q]: [Vec2; 2]) -> bool {
        let [leg_m, side_m] = [self.leg_m, [q[0] - p[0], q[1] - p[1]]];
        let aside = |along: Vec2, from: Vec2, to: Vec2| {
            along[0] * (to[1] - from[1]) - along[1] * (to[0] - from[0])
        };
        let are_apart = |one: f64, other: f64, along: Vec2| {
            let hair = HAIR_M * (along[0].abs() + along[1].abs());
            one.min(other) < -hair && one.max(other) > hair
        };
        are_apart(aside(leg_m, self.a, p), aside(leg_m, self.a, q), leg_m)
            && are_apart(aside(side_m, p, self.a), aside(side_m, p, self.b), side_m)
    }
}

/// The upright box around an obstacle's outline and two of the outline's diagonals, which decide most
/// tests of points and moves without a look at all corners.
#[derive(Debug, Clone, Copy)]
pub(super) struct Gist {
    centre_m: Vec2,
    half_m: Vec2,
    radius_m: f64,
    /// Whether the outline is the box, up to rounding.
    is_upright: bool,
    diagonals_m: [[Vec2; 2]; 2],
}

impl Gist {
    /// Return whether a move surely touches the obstacle: it crosses a diagonal.
    pub(super) fn is_crossed_by(&self, sweep: &Sweep) -> bool {
        self.diagonals_m.iter().any(|&diagonal_m| sweep.crosses(diagonal_m))
    }

    /// Return whether all moves from a point into an upright box surely cross one of the diagonals.
    pub(super) fn hides(&self, from_m: Vec2, centre_m: Vec2, half_m: Vec2) -> bool {
        self.diagonals_m.iter().any(|&[p, q]| {
            let minus = |a: Vec2, b: Vec2| [a[0] - b[0], a[1] - b[1]];
            let cross = |a: Vec2, b: Vec2| a[0] * b[1] - a[1] * b[0];
            let (side_m, to_p, to_q) = (minus(q, p), minus(p, from_m), minus(q, from_m));
            // Seen from the point, the diagonal runs to the left or to the right.
            let facing = cross(to_p, to_q);
            let turn = facing.signum();
            // The least cross product of a vector and those from an origin to the box.
            let least = |along: Vec2, origin_m: Vec2, sign: f64| {
                sign * cross(along, minus(centre_m, origin_m))
                    - along[0].abs() * half_m[1]
                    - along[1].abs() * half_m[0]
            };
            let to_centre = minus(centre_m, from_m);
            let sum = |v: Vec2| v[0].abs() + v[1].abs();
            let hair = HAIR_M * (sum(to_centre) + sum(half_m));
            facing.abs() > HAIR_M * sum(side_m)
                && least(side_m, p, -turn) > HAIR_M * sum(side_m)
                && least(to_p, from_m, turn) > hair
                && least(to_q, from_m, -turn) > hair
        })
    }

    /// Return whether the agent's axis at a point is too close, if its box decides that.
    pub(super) fn blocks(&self, point_m: Vec2) -> Option<bool> {
        self.is_within(point_m, self.radius_m)
    }

    /// Return whether the agent's axis is surely too close at all points of an upright box.
    pub(super) fn covers(&self, centre_m: Vec2, half_m: Vec2) -> bool {
        let [x, z] = [0, 1].map(|i| {
            ((centre_m[i] - self.centre_m[i]).abs() + half_m[i] - self.half_m[i]).max(0.0)
        });
        let reach_m = self.radius_m - HAIR_M;
        self.is_upright && reach_m > 0.0 && x * x + z * z < reach_m * reach_m
    }

    /// Return whether the agent's axis is surely far enough away at all points of an upright box.
    pub(super) fn is_apart_from(&self, centre_m: Vec2, half_m: Vec2) -> bool {
        (0..2).any(|i| {
            let gap_m = (centre_m[i] - self.centre_m[i]).abs() - half_m[i] - self.half_m[i];
            gap_m > self.radius_m + HAIR_M
        })
    }

    /// Return [`Obstacle::hugs`], if its box decides that.
    pub(super) fn hugs(&self, point_m: Vec2) -> Option<bool> {
        self.is_within(point_m, HUG * self.radius_m)
    }

    fn is_within(&self, point_m: Vec2, reach_m: f64) -> Option<bool> {
        let [x, z] = [0, 1].map(|i| {
            let gap_m = (point_m[i] - self.centre_m[i]).abs() - self.half_m[i];
            // A number that is none stays none, so that the box decides nothing.
            if gap_m < 0.0 { 0.0 } else { gap_m }
        });
        let gap_m2 = x * x + z * z;
        if gap_m2 > (reach_m + HAIR_M).powi(2) {
            return Some(false);
        }
        let is_surely_near = reach_m > HAIR_M && gap_m2 < (reach_m - HAIR_M).powi(2);
        (self.is_upright && is_surely_near).then_some(true)
    }

    /// Return whether a move surely stays clear: its box is apart from the obstacle's, or the
    /// obstacle lies on one side of its line.
    pub(super) fn is_clear_of(&self, sweep: &Sweep) -> bool {
        let Sweep { a, leg_m, length_m, extent_m: [low_m, high_m], .. } = sweep;
        let is_apart = |i: usize| {
            let reach_m = self.half_m[i] + (self.radius_m + HAIR_M);
            low_m[i] - self.centre_m[i] > reach_m || self.centre_m[i] - high_m[i] > reach_m
        };
        if is_apart(0) || is_apart(1) {
            return true;
        }
        let [x, z] = [0, 1].map(|i| self.centre_m[i] - a[i]);
        let aside_m2 = (leg_m[0] * z - leg_m[1] * x).abs();
        let half_m2 = leg_m[1].abs() * self.half_m[0] + leg_m[0].abs() * self.half_m[1];
        aside_m2 > half_m2 + length_m * (self.radius_m + HAIR_M * (1.0 + length_m))
    }
}

impl Obstacle {
    /// Return what decides most tests of this obstacle.
    pub(super) fn gist(&self) -> Gist {
        let [low_m, high_m] = bounds_2d_m(self.outline_m.iter().copied());
        let centre_m = [0, 1].map(|i| 0.5 * (low_m[i] + high_m[i]));
        // Measured from the rounded centre, so that no corner is outside.
        let half_m = [0, 1].map(|i| (high_m[i] - centre_m[i]).max(centre_m[i] - low_m[i]));
        let num_corners = self.outline_m.len();
        let corner = |quarters: usize| self.outline_m[quarters * num_corners / 4];
        // Longer than the outline's by nearly the distance to keep, at both ends.
        let stretched = |[p, q]: [Vec2; 2]| {
            let leg_m = [q[0] - p[0], q[1] - p[1]];
            let length_m = leg_m[0].hypot(leg_m[1]);
            let share = if length_m > HAIR_M { STRETCH * self.radius_m / length_m } else { 0.0 };
            [
                [p[0] - share * leg_m[0], p[1] - share * leg_m[1]],
                [q[0] + share * leg_m[0], q[1] + share * leg_m[1]],
            ]
        };
        let diagonals_m = [[corner(0), corner(2)], [corner(1), corner(3)]].map(stretched);
        let is_at_corner = |p: &Vec2| {
            let gap_m = |i: usize| ((p[i] - centre_m[i]).abs() - half_m[i]).abs();
            gap_m(0) < 0.1 * HAIR_M && gap_m(1) < 0.1 * HAIR_M
        };
        let is_upright = num_corners == 4 && self.outline_m.iter().all(is_at_corner);
        Gist { centre_m, half_m, radius_m: self.radius_m, is_upright, diagonals_m }
    }

    /// Create an obstacle: the footprint grown by `radius_m`.
    pub(super) fn new(footprint: Footprint, radius_m: f64, body: usize) -> Self {
        let [low_m, high_m] = bounds_2d_m(footprint.outline_m.iter().copied());
        let min_m = low_m.map(|v| v - HUG * radius_m);
        let max_m = high_m.map(|v| v + HUG * radius_m);
        Self { outline_m: footprint.outline_m, radius_m, body, min_m, max_m }
    }

    /// Return the smallest and largest corner of a box that contains all blocked points.
    pub(crate) fn extent_m(&self) -> [Vec2; 2] {
        [self.min_m, self.max_m]
    }

    /// Return whether this obstacle surely blocks all points that the other one blocks; false if
    /// that is not certain.
    pub(super) fn covers(&self, other: &Self) -> bool {
        self.radius_m >= other.radius_m
            && (0..2).all(|i| self.min_m[i] <= other.min_m[i] && self.max_m[i] >= other.max_m[i])
            && other.outline_m.iter().all(|&p| distance_squared(&self.outline_m, p) == 0.0)
    }

    /// Return whether the agent's axis at `point_m` is too close.
    pub(crate) fn blocks(&self, point_m: Vec2) -> bool {
        let is_near = (0..2).all(|i| self.min_m[i] < point_m[i] && point_m[i] < self.max_m[i]);
        is_near && distance_squared(&self.outline_m, point_m) < self.radius_m * self.radius_m
    }

    /// Return whether a point is in collision or so close to it that it may lie between a rounded
    /// corner and the corner's tangents.
    pub(super) fn hugs(&self, point_m: Vec2) -> bool {
        distance_squared(&self.outline_m, point_m) < (HUG * self.radius_m).powi(2)
    }

    /// Return whether the agent's axis comes too close while it moves.
    ///
    /// If a segment and a convex polygon do not meet, their smallest distance is at an end of the
    /// segment or at a corner of the polygon.
    pub(crate) fn blocks_sweep(&self, sweep: &Sweep) -> bool {
        let reach = self.radius_m;
        let &Sweep { a, b, extent_m: [low_m, high_m], .. } = sweep;
        let is_near = (0..2).all(|i| self.min_m[i] < high_m[i] && low_m[i] < self.max_m[i]);
        if !is_near {
            return false;
        }
        let Frame { length_m, along } = sweep.frame();
        // Corners in the frame of the move: distance along it, distance to its left.
        let in_frame = |p: Vec2| {
            let w = [p[0] - a[0], p[1] - a[1]];
            [along[0] * w[0] + along[1] * w[1], along[0] * w[1] - along[1] * w[0]]
        };
        let (mut right, mut left) = (f64::INFINITY, f64::NEG_INFINITY);
        let mut before = in_frame(self.outline_m[self.outline_m.len() - 1]);
        let mut is_hit = false;
        for &corner in &self.outline_m {
            let here = in_frame(corner);
            right = right.min(here[1]);
            left = left.max(here[1]);
            is_hit |= here[1].abs() < reach && 0.0 < here[0] && here[0] < length_m;
            if (here[1] < 0.0) != (before[1] < 0.0) {
                let t = before[1] / (before[1] - here[1]);
                let crossing = before[0] + t * (here[0] - before[0]);
                is_hit |= (0.0..=length_m).contains(&crossing);
            }
            before = here;
        }
        if right >= reach || left <= -reach {
            return false;
        }
        is_hit || self.blocks(a) || self.blocks(b)
    }
}
