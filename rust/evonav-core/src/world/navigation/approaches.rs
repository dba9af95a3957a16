//! The nodes from which paths come to targets, kept for targets that are asked for again and again,
//! as the reachable positions of a house are for a table of all distances among them.

use std::{
    cell::Cell,
    sync::{Arc, Mutex, PoisonError},
};

use crate::{
    geometry::{Vec2, distance_2d_m},
    world::navigation::{Obstacles, nodes::Nodes, obstacles::NONE},
};

/// Number of calls for the same targets before their nodes are found, which takes as long as some
/// seven calls.
const PATIENCE: u32 = 7;

/// The nodes over which paths may come to each of some targets, whatever the start.
#[derive(Debug)]
pub(super) struct Approaches {
    /// Target `i` has `nodes[starts[i]..starts[i + 1]]`.
    starts: Vec<usize>,
    nodes: Vec<u32>,
    /// The length from each of `nodes` to its target.
    lengths_m: Vec<f64>,
}

impl Approaches {
    fn find(nodes: &Nodes, obstacles: &Obstacles, targets_m: &[Option<Vec2>]) -> Self {
        let mut found = Self { starts: vec![0], nodes: Vec::new(), lengths_m: Vec::new() };
        // The obstacle that last hid a target from each node.
        let blockers = vec![Cell::new(NONE); nodes.len()];
        for target_m in targets_m {
            if let &Some(target_m) = target_m {
                for node in nodes.next_to(obstacles, target_m) {
                    let point_m = nodes.point_m(node);
                    if obstacles.is_clear_between_after(point_m, target_m, &blockers[node]) {
                        found.nodes.push(node as u32);
                        found.lengths_m.push(distance_2d_m(point_m, target_m));
                    }
                }
            }
            found.starts.push(found.nodes.len());
        }
        found.nodes.shrink_to_fit();
        found.lengths_m.shrink_to_fit();
        found
    }

    /// Return the shortest distances from a start to the targets, given those to all nodes;
    /// infinite where there is no path, or no point.
    pub(super) fn distances_m(
        &self,
        obstacles: &Obstacles,
        start_m: Vec2,
        targets_m: &[Option<Vec2>],
        costs_m: &[f64],
    ) -> Vec<f64> {
        let blocker = Cell::new(NONE);
        let sees = |target_m| obstacles.is_clear_between_after(start_m, target_m, &blocker);
        let over_nodes_m = |i: usize| {
            let range = self.starts[i]..self.starts[i + 1];
            let ways = self.nodes[range.clone()].iter().zip(&self.lengths_m[range]);
            let lengths_m = ways.map(|(&node, length_m)| costs_m[node as usize] + length_m);
            lengths_m.fold(f64::INFINITY, f64::min)
        };
        let distance_m = |(i, target_m): (usize, &Option<Vec2>)| match *target_m {
            Some(target_m) if sees(target_m) => distance_2d_m(start_m, target_m),
            _ => over_nodes_m(i),
        };
        targets_m.iter().enumerate().map(distance_m).collect()
    }
}

/// The targets of the last call, and how often they were asked for.
#[derive(Debug, Default)]
pub(super) struct Repeated {
    last: Mutex<Last>,
}

#[derive(Debug, Default)]
struct Last {
    targets_m: Vec<Option<Vec2>>,
    num_calls: u32,
    approaches: Option<Arc<Approaches>>,
}

impl Repeated {
    /// Return the nodes that lead to targets if the last calls were for the same ones.
    pub(super) fn approaches(
        &self,
        nodes: &Nodes,
        obstacles: &Obstacles,
        targets_m: &[Option<Vec2>],
    ) -> Option<Arc<Approaches>> {
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        if last.targets_m != targets_m {
            *last = Last { targets_m: targets_m.to_vec(), ..Last::default() };
        }
        last.num_calls = last.num_calls.saturating_add(1);
        if last.num_calls > PATIENCE && last.approaches.is_none() {
            last.approaches = Some(Arc::new(Approaches::find(nodes, obstacles, targets_m)));
        }
        last.approaches.clone()
    }
}
