//! Corners of grown obstacles as nodes of the visibility graph, which taut paths pass tangentially.

use std::{
    collections::HashMap,
    f64::consts::{FRAC_PI_2, FRAC_PI_8, TAU},
};

use crate::{
    geometry::Vec2,
    world::navigation::{
        Obstacle,
        nodes::{Node, Nodes},
    },
};

/// Largest turn of a path at one node around a corner.
const TURN_RAD: f64 = FRAC_PI_8;
/// Largest number of times that the turn at a node is halved to pass a narrow gap, down to two
/// tenths of a millimetre of room.
const MOST_SPLITS: u32 = 5;
/// Distance that nodes keep in addition to the agent's radius, so that an agent that walks an edge
/// in steps by rounded headings is never blocked: 1e-4 degrees are 2e-5 m after 10 m.
const SKIN_M: f64 = 1e-4;
/// The tangents that replace rounded corners, by the corner's directions. Most corners of a house
/// are right angles along its axes, so few differ.
#[derive(Debug, Default)]
pub(super) struct Fans {
    of_turn: HashMap<[u64; 2], Vec<Step>>,
}

/// Two tangents of a rounded corner, and the node between them.
#[derive(Debug, Clone, Copy)]
struct Step {
    span_rad: [f64; 2],
    normals: [Vec2; 2],
    /// Unit vector from the corner to the node.
    towards: Vec2,
    /// Cosine of half the angle between the tangents.
    half_cos: f64,
}

impl Step {
    fn new(span_rad: [f64; 2]) -> Self {
        let [first_rad, last_rad] = span_rad;
        let towards = unit_vector(0.5 * (first_rad + last_rad));
        let half_cos = (0.5 * (last_rad - first_rad)).cos();
        Self { span_rad, normals: span_rad.map(unit_vector), towards, half_cos }
    }

    /// Split the angle between the tangents in two.
    fn halves(&self) -> [Self; 2] {
        let [first_rad, last_rad] = self.span_rad;
        let middle_rad = 0.5 * (first_rad + last_rad);
        [[first_rad, middle_rad], [middle_rad, last_rad]].map(Self::new)
    }
}

fn unit_vector(angle_rad: f64) -> Vec2 {
    let (sin, cos) = angle_rad.sin_cos();
    [cos, sin]
}

impl Fans {
    /// Add the free corners of the polygon of tangents around an obstacle's grown outline.
    pub(super) fn push_corner_nodes(
        &mut self,
        obstacle: &Obstacle,
        is_free: &impl Fn(Vec2) -> bool,
        nodes: &mut Nodes,
    ) {
        let outline = &obstacle.outline_m;
        let heading = |a: Vec2, b: Vec2| (b[1] - a[1]).atan2(b[0] - a[0]);
        let mut arrive_rad = heading(outline[outline.len() - 1], outline[0]);
        for (i, &corner_m) in outline.iter().enumerate() {
            let leave_rad = heading(corner_m, outline[(i + 1) % outline.len()]);
            // The outline turns left, so its outward normals are a quarter turn to the right.
            let turn = if outline.len() == 1 {
                [0.0, TAU]
            } else {
                [arrive_rad - FRAC_PI_2, (leave_rad - arrive_rad).rem_euclid(TAU)]
            };
            arrive_rad = leave_rad;
            let arc = Arc { corner_m, radius_m: obstacle.radius_m + SKIN_M };
            for step in self.steps_of(turn) {
                arc.push_nodes(step, 0, is_free, nodes);
            }
        }
    }

    /// Return the steps of a corner that turns from an angle by an angle.
    fn steps_of(&mut self, [first_rad, turn_rad]: [f64; 2]) -> &[Step] {
        self.of_turn.entry([first_rad, turn_rad].map(f64::to_bits)).or_insert_with(|| {
            let num_steps = (turn_rad / TURN_RAD - 1e-9).ceil().max(1.0);
            let at = |k: usize| first_rad + turn_rad * k as f64 / num_steps;
            (0..num_steps as usize).map(|k| Step::new([at(k), at(k + 1)])).collect()
        })
    }
}

/// The rounded corner of a grown obstacle.
struct Arc {
    corner_m: Vec2,
    radius_m: f64,
}

impl Arc {
    /// Add the node between two tangents. If another obstacle is so near that the node is not free
    /// but the arc is, add the nodes of both halves instead, which are nearer to the arc.
    fn push_nodes(
        &self,
        step: &Step,
        depth: u32,
        is_free: &impl Fn(Vec2) -> bool,
        nodes: &mut Nodes,
    ) {
        let at = |reach_m: f64| [0, 1].map(|i| self.corner_m[i] + reach_m * step.towards[i]);
        let point_m = at(self.radius_m / step.half_cos);
        if is_free(point_m) {
            nodes.push(Node { point_m, normals: step.normals });
        } else if depth < MOST_SPLITS && is_free(at(self.radius_m)) {
            for half in step.halves() {
                self.push_nodes(&half, depth + 1, is_free, nodes);
            }
        }
    }
}
