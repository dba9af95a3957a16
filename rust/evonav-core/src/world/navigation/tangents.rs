//! Corners of grown obstacles as nodes of the visibility graph, which taut paths pass tangentially.

use std::{
    collections::HashMap,
    f64::consts::{FRAC_PI_2, FRAC_PI_8, TAU},
    hash::{BuildHasherDefault, Hasher},
};

use crate::{
    geometry::{Vec2, bounds_2d_m},
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
    of_turn: HashMap<(u64, u64), Fan, BuildHasherDefault<Mix>>,
}

/// A hash of two numbers by multiplication, for keys that nobody chooses to collide.
#[derive(Debug, Default)]
struct Mix(u64);

impl Hasher for Mix {
    fn write(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|&byte| self.write_u64(u64::from(byte)));
    }

    fn write_u64(&mut self, value: u64) {
        let product = u128::from(self.0.rotate_left(32) ^ value) * 0x9e37_79b9_7f4a_7c15;
        self.0 = (product >> 64) as u64 ^ product as u64;
    }

    fn finish(&self) -> u64 {
        self.0
    }
}

/// The tangents around a corner, and the middle and half the size of a box around all points that
/// are tested, if the rounded corner has radius 1.
#[derive(Debug)]
struct Fan {
    steps: Vec<Step>,
    centre: Vec2,
    half: Vec2,
}

impl Fan {
    fn new([first_rad, turn_rad]: [f64; 2]) -> Self {
        let num_steps = (turn_rad / TURN_RAD - 1e-9).ceil().max(1.0);
        let at = |k: usize| first_rad + turn_rad * k as f64 / num_steps;
        let mut first = Tangent::new(at(0));
        let mut step_to = |k: usize| {
            let last = Tangent::new(at(k));
            Step::new(std::mem::replace(&mut first, last), last)
        };
        let steps: Vec<Step> = (1..=num_steps as usize).map(&mut step_to).collect();
        let reaches = |step: &Step| [1.0, 1.0 / step.half_cos].map(|v| step.towards.map(|t| v * t));
        let [low, high] = bounds_2d_m(steps.iter().flat_map(reaches));
        let centre = [0, 1].map(|i| 0.5 * (low[i] + high[i]));
        Self { steps, centre, half: [0, 1].map(|i| 0.5 * (high[i] - low[i])) }
    }
}

/// A tangent of a rounded corner, by its outward normal.
#[derive(Debug, Clone, Copy)]
struct Tangent {
    angle_rad: f64,
    normal: Vec2,
}

impl Tangent {
    fn new(angle_rad: f64) -> Self {
        Self { angle_rad, normal: unit_vector(angle_rad) }
    }
}

/// Two tangents of a rounded corner, and the node between them.
#[derive(Debug, Clone, Copy)]
struct Step {
    first: Tangent,
    last: Tangent,
    /// Unit vector from the corner to the node.
    towards: Vec2,
    /// Cosine of half the angle between the tangents.
    half_cos: f64,
}

impl Step {
    fn new(first: Tangent, last: Tangent) -> Self {
        let towards = unit_vector(0.5 * (first.angle_rad + last.angle_rad));
        let half_cos = (0.5 * (last.angle_rad - first.angle_rad)).cos();
        Self { first, last, towards, half_cos }
    }

    /// Split the angle between the tangents in two.
    fn halves(&self) -> [Self; 2] {
        let middle = Tangent::new(0.5 * (self.first.angle_rad + self.last.angle_rad));
        [Self::new(self.first, middle), Self::new(middle, self.last)]
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
        may_be_free: &impl Fn(Vec2, Vec2) -> bool,
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
            let fan = self.of_turn(turn);
            let centre_m = [0, 1].map(|k| corner_m[k] + arc.radius_m * fan.centre[k]);
            if may_be_free(centre_m, fan.half.map(|v| arc.radius_m * v)) {
                for step in &fan.steps {
                    arc.push_nodes(step, 0, is_free, nodes);
                }
            }
        }
    }

    /// Return the fan of a corner that turns from an angle by an angle.
    fn of_turn(&mut self, turn: [f64; 2]) -> &Fan {
        let key = (turn[0].to_bits(), turn[1].to_bits());
        self.of_turn.entry(key).or_insert_with(|| Fan::new(turn))
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
            let normals = [step.first.normal, step.last.normal];
            nodes.push(Node { point_m, normals });
        } else if depth < MOST_SPLITS && is_free(at(self.radius_m)) {
            for half in step.halves() {
                self.push_nodes(&half, depth + 1, is_free, nodes);
            }
        }
    }
}
