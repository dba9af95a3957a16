//! Corners of grown obstacles as nodes of the visibility graph, which taut paths pass tangentially.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_8, TAU};

use crate::{geometry::Vec2, world::navigation::Obstacle};

/// Largest turn of a path at one node around a corner.
const TURN_RAD: f64 = FRAC_PI_8;
/// Largest number of times that the turn at a node is halved to pass a narrow gap, down to two
/// tenths of a millimetre of room.
const MOST_SPLITS: u32 = 5;
/// Distance that nodes keep in addition to the agent's radius, so that an agent that walks an edge
/// in steps by rounded headings is never blocked: 1e-4 degrees are 2e-5 m after 10 m.
const SKIN_M: f64 = 1e-4;
/// Tolerance of the tangency test, metres over the length of an edge; it adds edges rather than
/// removing them.
const TANGENT_SLACK_M: f64 = 1e-6;

/// A place where shortest paths may bend.
#[derive(Debug, Clone, Copy)]
pub(super) struct Node {
    pub(super) point_m: Vec2,
    /// Outward normals of the obstacle's two tangents that meet here.
    normals: [Vec2; 2],
}

impl Node {
    /// Return whether a straight line through this node towards `point_m` grazes the obstacle here,
    /// rather than running into it on one side or the other.
    pub(super) fn is_tangent_to(&self, point_m: Vec2) -> bool {
        let leg = [point_m[0] - self.point_m[0], point_m[1] - self.point_m[1]];
        let [a, b] = self.normals.map(|n| n[0] * leg[0] + n[1] * leg[1]);
        a.min(b) <= TANGENT_SLACK_M && a.max(b) >= -TANGENT_SLACK_M
    }
}

/// Return the free corners of the polygon of tangents around an obstacle's grown outline.
pub(super) fn corner_nodes(obstacle: &Obstacle, is_free: &impl Fn(Vec2) -> bool) -> Vec<Node> {
    let outline = &obstacle.outline_m;
    let num_corners = outline.len();
    let mut nodes = Vec::new();
    for (i, &corner_m) in outline.iter().enumerate() {
        let before = outline[(i + num_corners - 1) % num_corners];
        let after = outline[(i + 1) % num_corners];
        let heading = |a: Vec2, b: Vec2| (b[1] - a[1]).atan2(b[0] - a[0]);
        // The outline turns left, so its outward normals are a quarter turn to the right.
        let (first_rad, turn_rad) = if num_corners == 1 {
            (0.0, TAU)
        } else {
            let (arrive, leave) = (heading(before, corner_m), heading(corner_m, after));
            (arrive - FRAC_PI_2, (leave - arrive).rem_euclid(TAU))
        };
        let num_steps = (turn_rad / TURN_RAD - 1e-9).ceil().max(1.0);
        let arc = Arc { corner_m, radius_m: obstacle.radius_m + SKIN_M };
        for k in 0..num_steps as usize {
            let at = |k: usize| first_rad + turn_rad * k as f64 / num_steps;
            arc.push_nodes([at(k), at(k + 1)], 0, is_free, &mut nodes);
        }
    }
    nodes
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
        span_rad: [f64; 2],
        depth: u32,
        is_free: &impl Fn(Vec2) -> bool,
        nodes: &mut Vec<Node>,
    ) {
        let normal = |angle_rad: f64| {
            let (sin, cos) = angle_rad.sin_cos();
            [cos, sin]
        };
        let middle_rad = 0.5 * (span_rad[0] + span_rad[1]);
        let towards = normal(middle_rad);
        let at = |reach_m: f64| [0, 1].map(|i| self.corner_m[i] + reach_m * towards[i]);
        let point_m = at(self.radius_m / (0.5 * (span_rad[1] - span_rad[0])).cos());
        if is_free(point_m) {
            nodes.push(Node { point_m, normals: span_rad.map(normal) });
        } else if depth < MOST_SPLITS && is_free(at(self.radius_m)) {
            for half in [[span_rad[0], middle_rad], [middle_rad, span_rad[1]]] {
                self.push_nodes(half, depth + 1, is_free, nodes);
            }
        }
    }
}
