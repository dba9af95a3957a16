//! Exact collision of the agent's capsule with the world, on the ground plane.
//!
//! An upright capsule that slides over a flat floor has two degrees of freedom, so collision is a
//! problem in the plane. Each convex part contributes the projection of its slice between the step
//! height and the agent's height (a convex polygon, [`crate::world::footprint`]). The agent is in
//! collision if its axis comes closer to that polygon than the capsule's radius *at those heights*:
//! the rounded ends pass over low objects and under high ones. This is exact for upright prisms, as
//! nearly all parts are, and on the safe side for tapering parts. There is no cell size, so no gap
//! becomes too narrow or too wide by a cell.

use std::cell::Cell;

use crate::{
    Error,
    geometry::{Vec2, bounds_2d_m},
    world::{
        navigation::{
            AgentBody,
            obstacle::{Gist, Obstacle, Sweep, obstacles_of},
        },
        scene::{Body, BodyKind},
    },
};

/// Edge length of a bucket of the broad phase.
const BUCKET_M: f64 = 0.5;
/// Largest number of buckets along an axis, whatever the size of the house.
const MAX_BUCKETS: f64 = 1024.0;
/// Margin of bucket look-ups, far above rounding and far below any geometry.
const HAIR_M: f64 = 1e-7;
/// The number that stands for no obstacle, before any has blocked something.
pub(super) const NONE: u32 = u32::MAX;

/// All obstacles of an agent, indexed for exact queries.
#[derive(Debug, Clone)]
pub struct Obstacles {
    obstacles: Vec<Obstacle>,
    /// The boxes and diagonals that are tested before the outlines.
    gists: Vec<Gist>,
    corner_m: Vec2,
    bucket_m: f64,
    shape: [usize; 2],
    /// Bucket `i` holds `items[starts[i]..starts[i + 1]]`.
    starts: Vec<u32>,
    items: Vec<u32>,
}

impl Obstacles {
    /// Build the obstacles for `agent` from `bodies`: all but floors and ceilings, sliced between
    /// `step_height_m` and the agent's height.
    ///
    /// # Errors
    /// [`Error::Simulation`] naming the body if a part's geometry is not finite.
    pub fn build(bodies: &[Body], agent: AgentBody, step_height_m: f64) -> Result<Self, Error> {
        let mut obstacles = Vec::new();
        for (index, body) in bodies.iter().enumerate() {
            if matches!(body.kind, BodyKind::Floor | BodyKind::Ceiling) {
                continue;
            }
            obstacles.extend(obstacles_of(body, index, agent, step_height_m)?);
        }
        let mut obstacles = Self::with_buckets(obstacles);
        obstacles.drop_covered_by_others();
        Ok(obstacles)
    }

    /// Iterate over the obstacles, in the order of their bodies.
    pub fn iter(&self) -> impl Iterator<Item = &Obstacle> {
        self.obstacles.iter()
    }

    /// Return whether the agent fits at a point.
    pub fn is_clear(&self, point_m: Vec2) -> bool {
        self.is_clear_after(point_m, &Cell::new(NONE))
    }

    /// Return [`Self::is_clear`] for one of several points near each other: the obstacle that
    /// blocked the last one is tested first.
    pub(super) fn is_clear_after(&self, point_m: Vec2, blocker: &Cell<u32>) -> bool {
        let blocks = |i: u32| {
            let by_box = self.gists[i as usize].blocks(point_m);
            by_box.unwrap_or_else(|| self.obstacles[i as usize].blocks(point_m))
        };
        if blocker.get() != NONE && blocks(blocker.get()) {
            return false;
        }
        let Some([row, col]) = self.bucket_of(point_m) else { return true };
        let Some(&found) = self.bucket(row, col).iter().find(|&&i| blocks(i)) else { return true };
        blocker.set(found);
        false
    }

    /// Return whether one obstacle surely blocks all points of a small upright box: `blocker`, or
    /// one near the middle.
    pub(super) fn cover(&self, centre_m: Vec2, half_m: Vec2, blocker: &Cell<u32>) -> bool {
        let covers = |i: u32| self.gists[i as usize].covers(centre_m, half_m);
        if blocker.get() != NONE && covers(blocker.get()) {
            return true;
        }
        let Some([row, col]) = self.bucket_of(centre_m) else { return false };
        let Some(&found) = self.bucket(row, col).iter().find(|&&i| covers(i)) else { return false };
        blocker.set(found);
        true
    }

    /// Return whether a point is in collision or so close to it that it may lie between a rounded
    /// corner and the corner's tangents.
    pub(super) fn is_hugged(&self, point_m: Vec2) -> bool {
        let Some([row, col]) = self.bucket_of(point_m) else { return false };
        self.bucket(row, col).iter().any(|&i| {
            let by_box = self.gists[i as usize].hugs(point_m);
            by_box.unwrap_or_else(|| self.obstacles[i as usize].hugs(point_m))
        })
    }

    /// Return whether the agent can slide straight from one point to the other.
    ///
    /// The answer is the same in both directions.
    pub fn is_clear_between(&self, from_m: Vec2, to_m: Vec2) -> bool {
        self.first_between(from_m, to_m, NONE).is_none()
    }

    /// Return the index in the scene of a body that a straight move touches; `None` if it touches
    /// none.
    pub fn blocker_between(&self, from_m: Vec2, to_m: Vec2) -> Option<usize> {
        let blocker = self.first_between(from_m, to_m, NONE)?;
        Some(self.obstacles[blocker as usize].body)
    }

    /// Return [`Self::is_clear_between`] for one of several moves near each other: the obstacle that
    /// blocked the last one is tested first.
    pub(super) fn is_clear_between_after(
        &self,
        from_m: Vec2,
        to_m: Vec2,
        blocker: &Cell<u32>,
    ) -> bool {
        let found = self.first_between(from_m, to_m, blocker.get());
        if let Some(found) = found {
            blocker.set(found);
        }
        found.is_none()
    }

    /// Return whether an obstacle blocks a move, if a diagonal of it decides that; false for
    /// [`NONE`].
    pub(super) fn surely_blocks(&self, obstacle: u32, from_m: Vec2, to_m: Vec2) -> bool {
        let gist = self.gists.get(obstacle as usize);
        gist.is_some_and(|gist| gist.is_crossed_by(&Sweep::new(from_m, to_m)))
    }

    /// Return whether an obstacle surely hides a whole upright box from a point; false for [`NONE`].
    pub(super) fn hides(&self, obstacle: u32, from_m: Vec2, centre_m: Vec2, half_m: Vec2) -> bool {
        let gist = self.gists.get(obstacle as usize);
        gist.is_some_and(|gist| gist.hides(from_m, centre_m, half_m))
    }

    /// Return an obstacle that blocks a move: `likely` if it does, else the first along the move.
    pub(super) fn first_between(&self, from_m: Vec2, to_m: Vec2, likely: u32) -> Option<u32> {
        let (a, b) = if from_m <= to_m { (from_m, to_m) } else { (to_m, from_m) };
        let sweep = Sweep::new(a, b);
        let crosses = |i: u32| self.gists[i as usize].is_crossed_by(&sweep);
        let is_clear_of = |i: u32| self.gists[i as usize].is_clear_of(&sweep);
        let blocks_exactly = |i: u32| self.obstacles[i as usize].blocks_sweep(&sweep);
        if likely != NONE && (crosses(likely) || !is_clear_of(likely) && blocks_exactly(likely)) {
            return Some(likely);
        }
        // The obstacle that was last found not to block, which several buckets may have.
        let mut passed = likely;
        let mut blocks = |&i: &u32| {
            if i == passed || is_clear_of(i) {
                return false;
            }
            passed = i;
            crosses(i) || blocks_exactly(i)
        };
        let mut hit = None;
        self.buckets_along(a, b, |bucket| {
            hit = bucket.iter().copied().find(&mut blocks);
            hit.is_none()
        });
        hit
    }

    /// Call `visit` for the buckets under a segment until it returns false; return whether it never
    /// did.
    fn buckets_along(&self, a: Vec2, b: Vec2, mut visit: impl FnMut(&[u32]) -> bool) -> bool {
        let per_m = 1.0 / self.bucket_m;
        let cell = |value: f64, axis: usize| {
            ((value - self.corner_m[axis]) * per_m).max(0.0) as u32 as usize
        };
        let is_outside = (0..2).any(|i| a[i].max(b[i]) < self.corner_m[i]);
        if is_outside || self.obstacles.is_empty() {
            return true;
        }
        let last_row = cell(a[1].max(b[1]) + HAIR_M, 1).min(self.shape[0] - 1);
        let [width_m, height_m] = [b[0] - a[0], b[1] - a[1]];
        let is_level = height_m.abs() < HAIR_M;
        let share = 1.0 / height_m;
        for row in cell(a[1].min(b[1]) - HAIR_M, 1)..=last_row {
            // Stretch of the segment inside this row of buckets.
            let low = self.corner_m[1] + row as f64 * self.bucket_m - HAIR_M;
            let high = low + self.bucket_m + 2.0 * HAIR_M;
            let at = |height: f64| ((height - a[1]) * share).clamp(0.0, 1.0);
            let span = if is_level { [0.0, 1.0] } else { [at(low), at(high)] };
            let [x0, x1] = span.map(|t| a[0] + t * width_m);
            if x0.max(x1) + HAIR_M < self.corner_m[0] {
                continue;
            }
            let last_col = cell(x0.max(x1) + HAIR_M, 0).min(self.shape[1] - 1);
            for col in cell(x0.min(x1) - HAIR_M, 0)..=last_col {
                if !visit(self.bucket(row, col)) {
                    return false;
                }
            }
        }
        true
    }

    fn with_buckets(obstacles: Vec<Obstacle>) -> Self {
        let corners = obstacles.iter().flat_map(Obstacle::extent_m);
        let [corner_m, far_m] =
            if obstacles.is_empty() { [[0.0; 2]; 2] } else { bounds_2d_m(corners) };
        let extent_m = (far_m[0] - corner_m[0]).max(far_m[1] - corner_m[1]);
        let bucket_m = BUCKET_M.max(extent_m / MAX_BUCKETS);
        let count = |axis: usize| ((far_m[axis] - corner_m[axis]) / bucket_m) as usize + 1;
        let shape = [count(1), count(0)];
        let (gists, starts, items) = (Vec::new(), Vec::new(), Vec::new());
        let mut built = Self { obstacles, gists, corner_m, bucket_m, shape, starts, items };
        built.fill_buckets();
        built
    }

    /// Sort the obstacles into every bucket that their box touches, by counting sort.
    fn fill_buckets(&mut self) {
        let mut starts = vec![0_u32; self.shape[0] * self.shape[1] + 1];
        for obstacle in &self.obstacles {
            self.buckets_under(obstacle, |bucket| starts[bucket + 1] += 1);
        }
        for i in 1..starts.len() {
            starts[i] += starts[i - 1];
        }
        let mut next = starts.clone();
        let mut items = vec![0_u32; starts.last().copied().unwrap_or(0) as usize];
        for (i, obstacle) in self.obstacles.iter().enumerate() {
            self.buckets_under(obstacle, |bucket| {
                items[next[bucket] as usize] = i as u32;
                next[bucket] += 1;
            });
        }
        (self.starts, self.items) = (starts, items);
    }

    fn buckets_under(&self, obstacle: &Obstacle, mut visit: impl FnMut(usize)) {
        let cell = |value: f64, axis: usize| {
            let last = self.shape[1 - axis] - 1;
            (((value - self.corner_m[axis]) / self.bucket_m).max(0.0) as usize).min(last)
        };
        for row in cell(obstacle.min_m[1], 1)..=cell(obstacle.max_m[1], 1) {
            for col in cell(obstacle.min_m[0], 0)..=cell(obstacle.max_m[0], 0) {
                visit(row * self.shape[1] + col);
            }
        }
    }

    fn bucket(&self, row: usize, col: usize) -> &[u32] {
        let i = row * self.shape[1] + col;
        &self.items[self.starts[i] as usize..self.starts[i + 1] as usize]
    }

    fn bucket_of(&self, point_m: Vec2) -> Option<[usize; 2]> {
        let cell = [1, 0].map(|i| (point_m[i] - self.corner_m[i]) / self.bucket_m);
        let is_inside = (0..2).all(|i| cell[i] >= 0.0 && cell[i] < self.shape[i] as f64);
        is_inside.then_some(cell.map(|v| v as usize))
    }

    /// Remove obstacles that lie completely under another one, as most objects on furniture do.
    fn drop_covered_by_others(&mut self) {
        let is_covered = |i: usize| {
            let obstacle = &self.obstacles[i];
            self.bucket_of(obstacle.outline_m[0]).is_some_and(|[row, col]| {
                self.bucket(row, col).iter().any(|&j| {
                    let other = &self.obstacles[j as usize];
                    j as usize != i
                        && other.covers(obstacle)
                        && !(obstacle.covers(other) && i < j as usize)
                })
            })
        };
        let keep: Vec<bool> = (0..self.obstacles.len()).map(|i| !is_covered(i)).collect();
        let mut keep = keep.into_iter();
        self.obstacles.retain(|_| keep.next().unwrap_or(true));
        self.fill_buckets();
        self.gists = self.obstacles.iter().map(Obstacle::gist).collect();
    }
}
