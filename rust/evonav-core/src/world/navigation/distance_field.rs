//! Shortest distances from one point to any other, read off the places where paths bend last.

use std::{
    array,
    sync::atomic::{AtomicU32, Ordering::Relaxed},
};

use crate::{
    geometry::{Vec2, distance_2d_m},
    world::navigation::{Obstacles, nodes::Node, obstacles::NONE},
};

/// Relative error of bounds that are computed by a square root instead of `hypot`, far above
/// rounding.
const HAIR: f64 = 1e-12;

/// Shortest distances from one point, computed by
/// [`field`](crate::world::navigation::VisibilityGraph::field).
///
/// It is valid only with the obstacles of the graph that computed it.
#[derive(Debug)]
pub struct DistanceField {
    start_m: Vec2,
    nodes: Vec<Reached>,
    /// The obstacle that last hid a point from each node, and from the start after them. They
    /// change the order of tests and nothing else.
    blockers: Vec<AtomicU32>,
}

/// A node that the start reaches, and the length of the shortest path to it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reached {
    pub(super) node: Node,
    pub(super) cost_m: f64,
}

impl Reached {
    /// Join a node and the length of the shortest path to it.
    pub(super) fn new(node: Node, cost_m: f64) -> Self {
        Self { node, cost_m }
    }
}

impl DistanceField {
    /// Create the field of a start and the nodes that it reaches.
    pub(super) fn new(start_m: Vec2, nodes: impl Iterator<Item = Reached>) -> Self {
        let nodes: Vec<Reached> = nodes.collect();
        let blockers = (0..=nodes.len()).map(|_| AtomicU32::new(NONE)).collect();
        Self { start_m, nodes, blockers }
    }

    /// Return the nodes that the start reaches.
    pub(super) fn nodes(&self) -> &[Reached] {
        &self.nodes
    }

    /// Return the shortest distance from the start to a free point; infinite if there is no path.
    ///
    /// # Complexity
    /// O(n), and one visibility test for each node that may be the last before the point.
    pub(super) fn distance_m(&self, obstacles: &Obstacles, target_m: Vec2) -> f64 {
        self.straight_m(obstacles, target_m).unwrap_or_else(|| {
            let mut open = Vec::new();
            let is_hugged = obstacles.is_hugged(target_m);
            for (number, Reached { node, .. }) in (0_u32..).zip(&self.nodes) {
                if is_hugged || node.is_tangent_to(target_m) {
                    open.extend(self.bound_m(obstacles, number, target_m));
                }
            }
            self.least_m(obstacles, target_m, &mut open)
        })
    }

    /// Return the distance from the start if it sees the point.
    pub(super) fn straight_m(&self, obstacles: &Obstacles, target_m: Vec2) -> Option<f64> {
        let is_seen = self.sees(obstacles, self.nodes.len() as u32, target_m);
        is_seen.then(|| distance_2d_m(self.start_m, target_m))
    }

    /// Return the length of a path over a node, up to rounding, and the node; `None` if the node is
    /// surely hidden from the point.
    pub(super) fn bound_m(
        &self,
        obstacles: &Obstacles,
        number: u32,
        target_m: Vec2,
    ) -> Option<(f64, u32)> {
        let Reached { node, cost_m } = &self.nodes[number as usize];
        let is_hidden = obstacles.surely_blocks(self.blocker(number), node.point_m, target_m);
        (!is_hidden).then(|| {
            let [x, z]: Vec2 = array::from_fn(|i| node.point_m[i] - target_m[i]);
            (cost_m + (x * x + z * z).sqrt(), number)
        })
    }

    /// Return the length of the shortest path over one of some nodes that sees the point; infinite
    /// if none does. `open` has what [`Self::bound_m`] returns of each, and loses it.
    pub(super) fn least_m(
        &self,
        obstacles: &Obstacles,
        target_m: Vec2,
        open: &mut Vec<(f64, u32)>,
    ) -> f64 {
        let mut least_m = f64::INFINITY;
        loop {
            let shorter = |best: usize, i: usize| if open[i].0 < open[best].0 { i } else { best };
            let Some(i) = (0..open.len()).reduce(shorter) else { return least_m };
            let (bound_m, number) = open[i];
            if bound_m * (1.0 - HAIR) > least_m {
                return least_m;
            }
            open.swap_remove(i);
            let Reached { node: Node { point_m, .. }, cost_m } = self.nodes[number as usize];
            if self.sees(obstacles, number, target_m) {
                least_m = least_m.min(cost_m + distance_2d_m(point_m, target_m));
            }
        }
    }

    /// Return whether an upright box is surely hidden from a node, or from the start after all
    /// nodes, by what last hid a point from it.
    pub(super) fn is_hidden(
        &self,
        obstacles: &Obstacles,
        number: u32,
        centre_m: Vec2,
        half_m: Vec2,
    ) -> bool {
        obstacles.hides(self.blocker(number), self.place_m(number), centre_m, half_m)
    }

    fn blocker(&self, number: u32) -> u32 {
        self.blockers[number as usize].load(Relaxed)
    }

    fn place_m(&self, number: u32) -> Vec2 {
        self.nodes.get(number as usize).map_or(self.start_m, |reached| reached.node.point_m)
    }

    /// Return whether the straight way from a node (or the start, after all nodes) is clear.
    fn sees(&self, obstacles: &Obstacles, number: u32, target_m: Vec2) -> bool {
        let likely = self.blocker(number);
        let found = obstacles.first_between(self.place_m(number), target_m, likely);
        if let Some(found) = found.filter(|&found| found != likely) {
            self.blockers[number as usize].store(found, Relaxed);
        }
        found.is_none()
    }
}
