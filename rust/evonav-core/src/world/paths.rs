//! Any-angle shortest paths: a lazy tangent visibility graph over the grown obstacles.
//!
//! A shortest path among convex obstacles is a taut string: it bends only at convex corners of
//! the grown obstacles, and passes each of them tangentially. Corners are rounded, so each is
//! replaced by the tangent polygon around its arc, turning at most [`TURN_RAD`] a node; that
//! lengthens a path by at most 1.3% of its arcs. Edges are tested with the exact swept capsule,
//! so paths are collision-free to the last bit, and there is no cell size to trade against time.
//!
//! Tangency leaves one pair of nodes in sixty, and a node's edges are found when a search first
//! expands it, then kept: the first queries in a house pay for the rooms they cross.
//!
//! Source: Lozano-Pérez & Wesley, "An algorithm for planning collision-free paths among
//! polyhedral obstacles", CACM 1979; tangent pruning as in Oh & Leong, "Edge N-Level Sparse
//! Visibility Graphs", SoCS 2017.

use std::{cmp::Ordering, collections::BinaryHeap, sync::OnceLock};

use crate::{
    geometry::{Vec2, distance_2d_m},
    world::collision::{Obstacle, Obstacles},
};

/// Most that a path turns at one node around a corner.
const TURN_RAD: f64 = std::f64::consts::FRAC_PI_8;
/// Nodes keep this much more than the agent's radius, so that rounding never blocks an edge.
const SKIN_M: f64 = 1e-6;
/// Slack of the tangency test, metres over the length of an edge: errs towards more edges.
const TANGENT_SLACK_M: f64 = 1e-6;

/// Length of a polyline.
pub fn path_length_m(path_m: &[Vec2]) -> f64 {
    path_m.windows(2).map(|leg| distance_2d_m(leg[0], leg[1])).sum()
}

/// A place where shortest paths may bend.
#[derive(Debug, Clone, Copy)]
struct Node {
    point_m: Vec2,
    /// Outward normals of the obstacle's two tangents that meet here.
    normals: [Vec2; 2],
}

impl Node {
    /// Whether a straight line through this node towards `point_m` grazes the obstacle here,
    /// rather than running into it on one side or the other.
    fn is_tangent_to(&self, point_m: Vec2) -> bool {
        let leg = [point_m[0] - self.point_m[0], point_m[1] - self.point_m[1]];
        let [a, b] = self.normals.map(|n| n[0] * leg[0] + n[1] * leg[1]);
        a.min(b) <= TANGENT_SLACK_M && a.max(b) >= -TANGENT_SLACK_M
    }
}

#[derive(Debug, Clone, Copy)]
struct Edge {
    to: u32,
    length_m: f64,
}

/// The graph of all taut paths of one scene and agent.
#[derive(Debug)]
pub struct VisibilityGraph {
    nodes: Vec<Node>,
    edges: Vec<OnceLock<Box<[Edge]>>>,
}

/// Where a search stands: least cost first, then least node, so that ties have one outcome.
#[derive(PartialEq)]
struct Open {
    cost_m: f64,
    node: u32,
}

impl Eq for Open {}

impl Ord for Open {
    fn cmp(&self, other: &Self) -> Ordering {
        other.cost_m.total_cmp(&self.cost_m).then(other.node.cmp(&self.node))
    }
}

impl PartialOrd for Open {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// Node number of a search's target.
const TARGET: u32 = u32::MAX;
/// Parent of the nodes that a search's start sees.
const START: u32 = u32::MAX - 1;

impl VisibilityGraph {
    /// Nodes around every obstacle, where `is_free` allows the agent to stand.
    pub fn build(obstacles: &Obstacles, is_free: impl Fn(Vec2) -> bool) -> Self {
        let nodes: Vec<Node> =
            obstacles.iter().flat_map(corner_nodes).filter(|node| is_free(node.point_m)).collect();
        let edges = nodes.iter().map(|_| OnceLock::new()).collect();
        Self { nodes, edges }
    }

    /// Number of places where paths may bend.
    pub fn num_nodes(&self) -> usize {
        self.nodes.len()
    }

    /// Shortest path between two free points, both included; `None` if there is none.
    ///
    /// # Complexity
    /// A* with the straight line as heuristic: O(k (n + log n)) for k expansions among n nodes
    /// the first time, O(k log n) where earlier searches have been.
    pub fn shortest_path(
        &self,
        obstacles: &Obstacles,
        start_m: Vec2,
        target_m: Vec2,
    ) -> Option<Vec<Vec2>> {
        if obstacles.is_clear_between(start_m, target_m) {
            return Some(vec![start_m, target_m]);
        }
        let ahead_m: Vec<f64> =
            self.nodes.iter().map(|node| distance_2d_m(node.point_m, target_m)).collect();
        let mut search = Search::new(self.nodes.len());
        for edge in self.seen_from(obstacles, start_m) {
            let ahead = ahead_m[edge.to as usize];
            search.reach(edge.to, START, edge.length_m, ahead);
        }
        let mut to_target = (f64::INFINITY, START);
        while let Some((node, _)) = search.pop() {
            if node == TARGET {
                return Some(self.trace(&search, to_target.1, start_m, target_m));
            }
            let i = node as usize;
            let total_m = search.cost_m[i] + ahead_m[i];
            if total_m < to_target.0
                && self.nodes[i].is_tangent_to(target_m)
                && obstacles.is_clear_between(self.nodes[i].point_m, target_m)
            {
                to_target = (total_m, node);
                search.open.push(Open { cost_m: total_m, node: TARGET });
            }
            for edge in self.edges_of(obstacles, node) {
                let cost_m = search.cost_m[i] + edge.length_m;
                search.reach(edge.to, node, cost_m, ahead_m[edge.to as usize]);
            }
        }
        None
    }

    /// Shortest distances from a free point to many free points; infinite where there is no way.
    pub fn distances_m(
        &self,
        obstacles: &Obstacles,
        start_m: Vec2,
        targets_m: &[Vec2],
    ) -> Vec<f64> {
        let mut search = Search::new(self.nodes.len());
        for edge in self.seen_from(obstacles, start_m) {
            search.reach(edge.to, START, edge.length_m, 0.0);
        }
        while let Some((node, cost_m)) = search.pop() {
            for edge in self.edges_of(obstacles, node) {
                search.reach(edge.to, node, cost_m + edge.length_m, 0.0);
            }
        }
        targets_m
            .iter()
            .map(|&target_m| {
                if obstacles.is_clear_between(start_m, target_m) {
                    return distance_2d_m(start_m, target_m);
                }
                self.last_leg(obstacles, &search, target_m)
            })
            .collect()
    }

    /// Least cost to a target over the nodes that see it, given the costs to all nodes.
    fn last_leg(&self, obstacles: &Obstacles, search: &Search, target_m: Vec2) -> f64 {
        let mut open: BinaryHeap<Open> = (0..self.nodes.len())
            .filter(|&i| search.cost_m[i].is_finite() && self.nodes[i].is_tangent_to(target_m))
            .map(|i| Open {
                cost_m: search.cost_m[i] + distance_2d_m(self.nodes[i].point_m, target_m),
                node: i as u32,
            })
            .collect();
        while let Some(Open { cost_m, node }) = open.pop() {
            if obstacles.is_clear_between(self.nodes[node as usize].point_m, target_m) {
                return cost_m;
            }
        }
        f64::INFINITY
    }

    /// Nodes that a taut path from `point_m` may go to first.
    fn seen_from(&self, obstacles: &Obstacles, point_m: Vec2) -> Vec<Edge> {
        let is_seen = |node: &Node| {
            node.is_tangent_to(point_m) && obstacles.is_clear_between(point_m, node.point_m)
        };
        let to_edge = |(i, node): (usize, &Node)| Edge {
            to: i as u32,
            length_m: distance_2d_m(point_m, node.point_m),
        };
        self.nodes.iter().enumerate().filter(|(_, node)| is_seen(node)).map(to_edge).collect()
    }

    fn edges_of(&self, obstacles: &Obstacles, node: u32) -> &[Edge] {
        self.edges[node as usize].get_or_init(|| {
            let here = self.nodes[node as usize];
            let mut edges = self.seen_from_node(obstacles, node, here);
            edges.shrink_to_fit();
            edges.into_boxed_slice()
        })
    }

    fn seen_from_node(&self, obstacles: &Obstacles, node: u32, here: Node) -> Vec<Edge> {
        let mut edges = Vec::new();
        for (i, other) in self.nodes.iter().enumerate() {
            let is_candidate = i != node as usize
                && here.is_tangent_to(other.point_m)
                && other.is_tangent_to(here.point_m);
            if is_candidate && obstacles.is_clear_between(here.point_m, other.point_m) {
                let length_m = distance_2d_m(here.point_m, other.point_m);
                edges.push(Edge { to: i as u32, length_m });
            }
        }
        edges
    }

    fn trace(&self, search: &Search, last: u32, start_m: Vec2, target_m: Vec2) -> Vec<Vec2> {
        let mut path = vec![target_m];
        let mut node = last;
        while node != START {
            path.push(self.nodes[node as usize].point_m);
            node = search.parents[node as usize];
        }
        path.push(start_m);
        path.reverse();
        path
    }
}

/// Costs so far, and the open list.
struct Search {
    cost_m: Vec<f64>,
    parents: Vec<u32>,
    is_closed: Vec<bool>,
    open: BinaryHeap<Open>,
}

impl Search {
    fn new(num_nodes: usize) -> Self {
        Self {
            cost_m: vec![f64::INFINITY; num_nodes],
            parents: vec![START; num_nodes],
            is_closed: vec![false; num_nodes],
            open: BinaryHeap::new(),
        }
    }

    fn reach(&mut self, node: u32, parent: u32, cost_m: f64, ahead_m: f64) {
        if cost_m < self.cost_m[node as usize] {
            self.cost_m[node as usize] = cost_m;
            self.parents[node as usize] = parent;
            self.open.push(Open { cost_m: cost_m + ahead_m, node });
        }
    }

    /// The best open node, once each, with its cost; or the target.
    fn pop(&mut self) -> Option<(u32, f64)> {
        while let Some(Open { node, cost_m }) = self.open.pop() {
            if node == TARGET {
                return Some((node, cost_m));
            }
            let is_closed = &mut self.is_closed[node as usize];
            if !std::mem::replace(is_closed, true) {
                return Some((node, self.cost_m[node as usize]));
            }
        }
        None
    }
}

/// Corners of the polygon of tangents around an obstacle's grown outline.
fn corner_nodes(obstacle: &Obstacle) -> Vec<Node> {
    let outline = &obstacle.outline_m;
    let radius_m = obstacle.radius_m + SKIN_M;
    let num_corners = outline.len();
    let mut nodes = Vec::new();
    for (i, &corner) in outline.iter().enumerate() {
        let before = outline[(i + num_corners - 1) % num_corners];
        let after = outline[(i + 1) % num_corners];
        let heading = |a: Vec2, b: Vec2| (b[1] - a[1]).atan2(b[0] - a[0]);
        // The outline turns left, so its outward normals are a quarter turn to the right.
        let (first_rad, turn_rad) = if num_corners == 1 {
            (0.0, std::f64::consts::TAU)
        } else {
            let (arrive, leave) = (heading(before, corner), heading(corner, after));
            (
                arrive - std::f64::consts::FRAC_PI_2,
                (leave - arrive).rem_euclid(std::f64::consts::TAU),
            )
        };
        let num_steps = (turn_rad / TURN_RAD - 1e-9).ceil().max(1.0);
        let step_rad = turn_rad / num_steps;
        let reach_m = radius_m / (0.5 * step_rad).cos();
        let normal = |k: f64| {
            let (sin, cos) = (first_rad + k * step_rad).sin_cos();
            [cos, sin]
        };
        for k in 0..num_steps as usize {
            let k = k as f64;
            let towards = normal(k + 0.5);
            nodes.push(Node {
                point_m: [corner[0] + reach_m * towards[0], corner[1] + reach_m * towards[1]],
                normals: [normal(k), normal(k + 1.0)],
            });
        }
    }
    nodes
}
