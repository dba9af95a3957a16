//! The nodes of the visibility graph: places where taut paths may bend, and in which directions.

use evonav_simd::Kernel;

use crate::geometry::Vec2;

/// Tolerance of the tangency test, metres over the length of an edge; it adds edges rather than
/// removing them.
pub(super) const TANGENT_SLACK_M: f64 = 1e-6;

/// A place where shortest paths may bend.
#[derive(Debug, Clone, Copy)]
pub(super) struct Node {
    pub(super) point_m: Vec2,
    /// Outward normals of the obstacle's two tangents that meet here.
    pub(super) normals: [Vec2; 2],
}

impl Node {
    /// Create the end of a path, which touches no obstacle: every direction is tangent.
    pub(super) fn end(point_m: Vec2) -> Self {
        Self { point_m, normals: [[0.0; 2]; 2] }
    }

    /// Return whether a straight line through this node towards `point_m` grazes the obstacle here,
    /// rather than running into it on one side or the other.
    pub(super) fn is_tangent_to(&self, point_m: Vec2) -> bool {
        let leg = [point_m[0] - self.point_m[0], point_m[1] - self.point_m[1]];
        self.is_tangent_along(leg)
    }

    #[inline(always)]
    fn is_tangent_along(&self, leg: Vec2) -> bool {
        let [a, b] = self.normals.map(|n| n[0] * leg[0] + n[1] * leg[1]);
        ((a <= TANGENT_SLACK_M) | (b <= TANGENT_SLACK_M))
            & ((a >= -TANGENT_SLACK_M) | (b >= -TANGENT_SLACK_M))
    }
}

/// All nodes, in columns, so that tests of many of them take few instructions.
#[derive(Debug, Default)]
pub(super) struct Nodes {
    /// A column each for x, z, and x and z of the two normals.
    columns: [Vec<f64>; 6],
}

impl Nodes {
    pub(super) fn len(&self) -> usize {
        self.columns[0].len()
    }

    pub(super) fn push(&mut self, Node { point_m: [x, z], normals: [[ax, az], [bx, bz]] }: Node) {
        for (column, value) in self.columns.iter_mut().zip([x, z, ax, az, bx, bz]) {
            column.push(value);
        }
    }

    pub(super) fn at(&self, i: usize) -> Node {
        let [x, z, ax, az, bx, bz] = self.columns.each_ref().map(|column| column[i]);
        Node { point_m: [x, z], normals: [[ax, az], [bx, bz]] }
    }

    pub(super) fn point_m(&self, i: usize) -> Vec2 {
        [self.columns[0][i], self.columns[1][i]]
    }

    /// Return the nodes to which a straight line from a node may go so that it grazes the obstacles
    /// at both.
    pub(super) fn tangent_to(&self, here: Node) -> Vec<usize> {
        let are_tangent = evonav_simd::compute(Tangents { nodes: self, here });
        let mut found = Vec::new();
        for (k, block) in are_tangent.chunks(BLOCK).enumerate() {
            // Few blocks have any.
            if block.iter().fold(false, |any, is_tangent| any | is_tangent) {
                let numbers = (k * BLOCK..).zip(block);
                found.extend(numbers.filter(|(_, is_tangent)| **is_tangent).map(|(i, _)| i));
            }
        }
        found
    }
}

/// Number of nodes that are left out together if none of them is tangent.
const BLOCK: usize = 16;

struct Tangents<'a> {
    nodes: &'a Nodes,
    here: Node,
}

impl Kernel for Tangents<'_> {
    type Output = Vec<bool>;

    #[inline(always)]
    fn compute(self) -> Vec<bool> {
        let Self { nodes, here } = self;
        let mut are_tangent = vec![false; nodes.len()];
        let num = are_tangent.len();
        let [xs, zs, axs, azs, bxs, bzs] = nodes.columns.each_ref().map(|column| &column[..num]);
        for (i, is_tangent) in are_tangent.iter_mut().enumerate() {
            let normals = [[axs[i], azs[i]], [bxs[i], bzs[i]]];
            let there = Node { point_m: [xs[i], zs[i]], normals };
            let leg = [xs[i] - here.point_m[0], zs[i] - here.point_m[1]];
            *is_tangent = here.is_tangent_along(leg) & there.is_tangent_along(leg.map(|v| -v));
        }
        are_tangent
    }
}
