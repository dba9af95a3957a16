//! One obstacle: a convex polygon on the ground plane and the distance to keep from it.

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
    length_m: f64,
    /// Unit vector from `a` to `b`; any unit vector if they are equal.
    along: Vec2,
}

impl Sweep {
    /// Create the move from `a` to `b`.
    pub(crate) fn new(a: Vec2, b: Vec2) -> Self {
        let length_m = (b[0] - a[0]).hypot(b[1] - a[1]);
        let along = [(b[0] - a[0]) / length_m, (b[1] - a[1]) / length_m];
        Self { a, b, length_m, along: if length_m > 0.0 { along } else { [1.0, 0.0] } }
    }
}

impl Obstacle {
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
        let Sweep { a, b, length_m, along } = *sweep;
        let is_near =
            (0..2).all(|i| self.min_m[i] < a[i].max(b[i]) && a[i].min(b[i]) < self.max_m[i]);
        if !is_near {
            return false;
        }
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
