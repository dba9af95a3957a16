//! Shortest distances from one point to any other, read off the places where paths bend last.

use std::{
    array,
    sync::atomic::{AtomicU32, Ordering::Relaxed},
};

use crate::{
    geometry::{Vec2, bounds_2d_m, distance_2d_m},
    world::navigation::{Obstacles, obstacles::NONE, tangents::Node},
};

/// Number of nodes that are left out together where all are too far.
const GROUP: usize = 8;
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
    groups: Vec<Group>,
    /// The obstacle that last hid a point from each node, and from the start after them. They
    /// change the order of tests and nothing else.
    blockers: Vec<AtomicU32>,
}

/// A node that the start reaches, and the length of the shortest path to it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reached {
    node: Node,
    cost_m: f64,
}

impl Reached {
    /// Join a node and the length of the shortest path to it.
    pub(super) fn new(node: Node, cost_m: f64) -> Self {
        Self { node, cost_m }
    }
}

/// The box of some nodes, and the shortest path to any of them.
#[derive(Debug, Clone, Copy)]
struct Group {
    low_m: Vec2,
    high_m: Vec2,
    least_m: f64,
}

impl Group {
    fn of(nodes: &[Reached]) -> Self {
        let [low_m, high_m] = bounds_2d_m(nodes.iter().map(|reached| reached.node.point_m));
        let least_m = nodes.iter().fold(f64::INFINITY, |least, node| least.min(node.cost_m));
        Self { low_m, high_m, least_m }
    }
}

impl DistanceField {
    /// Create the field of a start and the nodes that it reaches.
    pub(super) fn new(start_m: Vec2, nodes: impl Iterator<Item = Reached>) -> Self {
        let nodes: Vec<Reached> = nodes.collect();
        let groups = nodes.chunks(GROUP).map(Group::of).collect();
        let blockers = (0..=nodes.len()).map(|_| AtomicU32::new(NONE)).collect();
        Self { start_m, nodes, groups, blockers }
    }

    /// Return the shortest distance from the start to a free point; infinite if there is no path.
    ///
    /// The point is farther than `likely_m` only if it does not see a node that leads to it within
    /// that length; any value gives the same distance.
    ///
    /// # Complexity
    /// O(n), and one visibility test for each node that may be the last before the point.
    pub(super) fn distance_m(&self, obstacles: &Obstacles, target_m: Vec2, likely_m: f64) -> f64 {
        if self.sees(obstacles, self.nodes.len(), self.start_m, target_m) {
            return distance_2d_m(self.start_m, target_m);
        }
        let is_hugged = obstacles.is_hugged(target_m);
        let least_m = |most_m| self.least_m(obstacles, target_m, is_hugged, most_m);
        let length_m = least_m(likely_m);
        if length_m <= likely_m { length_m } else { least_m(f64::INFINITY) }
    }

    /// Return the length of the shortest path over a node, among the nodes over which it may be at
    /// most `most_m`; infinite if none of them sees the point.
    fn least_m(&self, obstacles: &Obstacles, target_m: Vec2, is_hugged: bool, most_m: f64) -> f64 {
        let mut open = self.leading_to(obstacles, target_m, is_hugged, most_m);
        let mut least_m = f64::INFINITY;
        loop {
            let next = open.iter().enumerate().min_by(|(_, a), (_, b)| a.0.total_cmp(&b.0));
            let Some((i, &(bound_m, node))) = next else { return least_m };
            if bound_m * (1.0 - HAIR) > least_m {
                return least_m;
            }
            open.swap_remove(i);
            let Reached { node: Node { point_m, .. }, cost_m } = self.nodes[node as usize];
            let through_m = cost_m + distance_2d_m(point_m, target_m);
            if through_m < least_m && self.sees(obstacles, node as usize, point_m, target_m) {
                least_m = through_m;
            }
        }
    }

    /// Return the nodes that may be the last before a point, with the lengths of the paths over
    /// them up to rounding, at most `most_m`. Most nodes behind what hid the last point from them
    /// are left out.
    fn leading_to(
        &self,
        obstacles: &Obstacles,
        target_m: Vec2,
        is_hugged: bool,
        most_m: f64,
    ) -> Vec<(f64, u32)> {
        let most_m = most_m * (1.0 + HAIR);
        let is_within = |x: f64, z: f64, cost_m: f64| {
            let left_m = most_m - cost_m;
            left_m >= 0.0 && x * x + z * z <= left_m * left_m
        };
        let mut found = Vec::new();
        for (k, (group, nodes)) in self.groups.iter().zip(self.nodes.chunks(GROUP)).enumerate() {
            let [x, z]: Vec2 = array::from_fn(|i| {
                (group.low_m[i] - target_m[i]).max(target_m[i] - group.high_m[i]).max(0.0)
            });
            if !is_within(x, z, group.least_m) {
                continue;
            }
            for (i, &Reached { node, cost_m }) in nodes.iter().enumerate() {
                let [x, z]: Vec2 = array::from_fn(|i| node.point_m[i] - target_m[i]);
                let number = k * GROUP + i;
                let blocker = self.blockers[number].load(Relaxed);
                if is_within(x, z, cost_m)
                    && (is_hugged || node.is_tangent_to(target_m))
                    && !obstacles.surely_blocks(blocker, node.point_m, target_m)
                {
                    found.push((cost_m + (x * x + z * z).sqrt(), number as u32));
                }
            }
        }
        found
    }

    /// Return whether the straight way from a node (or the start, after all nodes) is clear.
    fn sees(&self, obstacles: &Obstacles, node: usize, from_m: Vec2, target_m: Vec2) -> bool {
        let likely = self.blockers[node].load(Relaxed);
        let found = obstacles.first_between(from_m, target_m, likely);
        if let Some(found) = found.filter(|&found| found != likely) {
            self.blockers[node].store(found, Relaxed);
        }
        found.is_none()
    }
}
