//! Any-angle shortest paths by a lazy tangent visibility graph over the grown obstacles.
//!
//! A shortest path among convex obstacles is a taut string: it bends only at convex corners of the
//! grown obstacles, and passes each of them tangentially. Corners are rounded, so each is replaced
//! by the tangent polygon around its arc, which turns at most 22.5 degrees per node; that lengthens
//! a path by at most 1.3% of its arcs. Edges are tested with the exact swept capsule, so paths are
//! free of collisions to the last bit, and there is no cell size to trade against time.
//!
//! Tangency excludes all but one in sixty pairs of nodes. A node's edges are computed when a search
//! first expands it and then stored, so the first queries in a house pay for the rooms that they
//! cross.
//!
//! Source: Lozano-Pérez & Wesley, "An algorithm for planning collision-free paths among
//! polyhedral obstacles", CACM 1979; tangent pruning as in Oh & Leong, "Edge N-Level Sparse
//! Visibility Graphs", SoCS 2017.

use std::{cell::Cell, cmp::Ordering, collections::BinaryHeap, sync::OnceLock};

use crate::{
    geometry::{Vec2, distance_2d_m},
    world::navigation::{
        Obstacles,
        distance_field::{DistanceField, Reached},
        distance_tiles,
        nodes::{Node, Nodes},
        obstacles::NONE,
        tangents::Fans,
    },
};

/// Return the length of a polyline.
pub fn path_length_m(path_m: &[Vec2]) -> f64 {
    path_m.windows(2).map(|leg| distance_2d_m(leg[0], leg[1])).sum()
}

#[derive(Debug, Clone, Copy)]
struct Edge {
    to: u32,
    length_m: f64,
}

/// The graph of all taut paths of one scene and agent.
#[derive(Debug)]
pub struct VisibilityGraph {
    nodes: Nodes,
    edges: Vec<OnceLock<Box<[Edge]>>>,
}

/// An entry of the open list. The smallest bound comes first, then the smallest node, so that ties
/// are resolved.
#[derive(Debug, Clone, Copy)]
struct Open {
    /// Lower bound of the length of a path through this node.
    bound_m: f64,
    /// Length of the path to this node.
    cost_m: f64,
    node: u32,
    parent: u32,
}

impl Ord for Open {
    fn cmp(&self, other: &Self) -> Ordering {
        other.bound_m.total_cmp(&self.bound_m).then(other.node.cmp(&self.node))
    }
}

impl PartialOrd for Open {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Open {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Open {}

/// Parent of the nodes that a search reaches directly from its start.
const START: u32 = u32::MAX;

impl VisibilityGraph {
    /// Build the graph: nodes around every obstacle where `is_free` allows the agent to stand.
    /// Where `may_be_free` is false, for the middle and half the size of an upright box, no point
    /// of the box is free.
    pub fn build(
        obstacles: &Obstacles,
        is_free: impl Fn(Vec2) -> bool,
        may_be_free: impl Fn(Vec2, Vec2) -> bool,
    ) -> Self {
        let (mut nodes, mut fans) = (Nodes::default(), Fans::default());
        for obstacle in obstacles.iter() {
            fans.push_corner_nodes(obstacle, &is_free, &may_be_free, &mut nodes);
        }
        let edges = (0..nodes.len()).map(|_| OnceLock::new()).collect();
        Self { nodes, edges }
    }

    /// Return the nodes to which a taut path from a start may go first.
    ///
    /// From an end that lies inside the tangents of a corner, no path passes that corner
    /// tangentially: it may lead to every node.
    fn first_after(&self, obstacles: &Obstacles, start_m: Vec2) -> Vec<usize> {
        if obstacles.is_hugged(start_m) {
            return (0..self.nodes.len()).collect();
        }
        self.nodes.tangent_to(Node::end(start_m))
    }

    /// Return the shortest path between two free points that do not see each other, both included;
    /// `None` if there is none.
    ///
    /// # Complexity
    /// A* with the straight line as heuristic: O(k (n + log n)) for k expansions among n nodes the
    /// first time, O(n + k log n) for nodes that earlier searches have expanded.
    pub fn shortest_path(
        &self,
        obstacles: &Obstacles,
        start_m: Vec2,
        target_m: Vec2,
    ) -> Option<Vec<Vec2>> {
        let ahead_m = |node: u32| distance_2d_m(self.nodes.point_m(node as usize), target_m);
        let mut search = Search::new(self.nodes.len());
        search.leave(self, obstacles, start_m, ahead_m);
        let blocker = Cell::new(NONE);
        let sees_target =
            |node: &Node| obstacles.is_clear_between_after(node.point_m, target_m, &blocker);
        let is_hugged = obstacles.is_hugged(target_m);
        while let Some(node) = search.pop(self, obstacles, start_m) {
            let here = self.nodes.at(node as usize);
            // Nodes are expanded in the order of the shortest path that may lead over them, so the
            // first node that sees the target is on the shortest path.
            if (is_hugged || here.is_tangent_to(target_m)) && sees_target(&here) {
                return Some(self.trace(&search, node, start_m, target_m));
            }
            let cost_m = search.cost_m[node as usize];
            for edge in self.edges_of(obstacles, node) {
                search.reach(edge.to, node, cost_m + edge.length_m, ahead_m);
            }
        }
        None
    }

    /// Return the shortest distances from a free point to many free points; infinite where there is
    /// no path, or no point.
    ///
    /// # Complexity
    /// That of [`Self::field`]; a point costs less the nearer it is to the one before it.
    pub fn distances_m(
        &self,
        obstacles: &Obstacles,
        start_m: Vec2,
        targets_m: &[Option<Vec2>],
    ) -> Vec<f64> {
        distance_tiles::distances_m(&self.field(obstacles, start_m), obstacles, targets_m)
    }

    /// Compute the shortest distances from a free point to all places where paths may bend.
    ///
    /// # Complexity
    /// Dijkstra over the whole graph: O(n log n + edges), and the cost of edges that are not
    /// computed yet.
    pub fn field(&self, obstacles: &Obstacles, start_m: Vec2) -> DistanceField {
        let mut search = Search::new(self.nodes.len());
        search.leave(self, obstacles, start_m, |_| 0.0);
        while let Some(node) = search.pop(self, obstacles, start_m) {
            let cost_m = search.cost_m[node as usize];
            for edge in self.edges_of(obstacles, node) {
                search.reach(edge.to, node, cost_m + edge.length_m, |_| 0.0);
            }
        }
        let reached = (0..self.nodes.len()).filter(|&i| search.is_closed[i]);
        DistanceField::new(
            start_m,
            reached.map(|i| Reached::new(self.nodes.at(i), search.cost_m[i])),
        )
    }

    fn edges_of(&self, obstacles: &Obstacles, node: u32) -> &[Edge] {
        self.edges[node as usize].get_or_init(|| {
            let mut edges = self.seen_from_node(obstacles, node as usize);
            edges.shrink_to_fit();
            edges.into_boxed_slice()
        })
    }

    fn seen_from_node(&self, obstacles: &Obstacles, node: usize) -> Vec<Edge> {
        let (here, blocker) = (self.nodes.at(node), Cell::new(NONE));
        let others = self.nodes.tangent_to(here).into_iter().filter(|&other| other != node);
        let seen = others.filter_map(|other| {
            let point_m = self.nodes.point_m(other);
            let is_seen = obstacles.is_clear_between_after(here.point_m, point_m, &blocker);
            let length_m = || distance_2d_m(here.point_m, point_m);
            is_seen.then(|| Edge { to: other as u32, length_m: length_m() })
        });
        seen.collect()
    }

    fn trace(&self, search: &Search, last: u32, start_m: Vec2, target_m: Vec2) -> Vec<Vec2> {
        let mut path = vec![target_m];
        let mut node = last;
        while node != START {
            path.push(self.nodes.point_m(node as usize));
            node = search.parents[node as usize];
        }
        path.push(start_m);
        path.reverse();
        path
    }
}

/// The state of a search: costs so far, and the open list.
#[derive(Debug)]
struct Search {
    cost_m: Vec<f64>,
    parents: Vec<u32>,
    is_closed: Vec<bool>,
    open: BinaryHeap<Open>,
    /// The obstacle that last hid a node from the start.
    blocker: Cell<u32>,
}

impl Search {
    fn new(num_nodes: usize) -> Self {
        Self {
            cost_m: vec![f64::INFINITY; num_nodes],
            parents: vec![START; num_nodes],
            is_closed: vec![false; num_nodes],
            open: BinaryHeap::new(),
            blocker: Cell::new(NONE),
        }
    }

    /// Open every node to which a taut path from the start may go first. Whether the start sees a
    /// node is tested only when the node is expanded, which most nodes never are.
    fn leave(
        &mut self,
        graph: &VisibilityGraph,
        obstacles: &Obstacles,
        start_m: Vec2,
        ahead_m: impl Fn(u32) -> f64,
    ) {
        let open = graph.first_after(obstacles, start_m).into_iter().map(|i| {
            let (node_index, cost_m) = (i as u32, distance_2d_m(start_m, graph.nodes.point_m(i)));
            let bound_m = cost_m + ahead_m(node_index);
            Open { bound_m, cost_m, node: node_index, parent: START }
        });
        self.open = open.collect();
    }

    /// Open a path along an edge if it is the best so far.
    fn reach(&mut self, node: u32, parent: u32, cost_m: f64, ahead_m: impl Fn(u32) -> f64) {
        if cost_m < self.cost_m[node as usize] {
            self.cost_m[node as usize] = cost_m;
            self.parents[node as usize] = parent;
            self.open.push(Open { bound_m: cost_m + ahead_m(node), cost_m, node, parent });
        }
    }

    /// Close the best open node.
    fn pop(
        &mut self,
        graph: &VisibilityGraph,
        obstacles: &Obstacles,
        start_m: Vec2,
    ) -> Option<u32> {
        while let Some(Open { cost_m, node, parent, .. }) = self.open.pop() {
            let i = node as usize;
            // The cost over an edge is set when the node is opened, the cost from the start once
            // the start is known to see the node.
            let is_stale = self.is_closed[i] || cost_m > self.cost_m[i];
            if is_stale
                || parent == START
                    && !obstacles.is_clear_between_after(
                        start_m,
                        graph.nodes.point_m(i),
                        &self.blocker,
                    )
            {
                continue;
            }
            (self.cost_m[i], self.parents[i], self.is_closed[i]) = (cost_m, parent, true);
            return Some(node);
        }
        None
    }
}
