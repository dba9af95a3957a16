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
    pub(super) fn tangent_to(&self, here: Node) -> impl Iterator<Item = usize> {
        let is_tangent = evonav_simd::compute(Tangents { nodes: self, here });
        is_tangent.into_iter().enumerate().filter_map(|(i, is_tangent)| is_tangent.then_some(i))
    }
}

struct Tangents<'a> {
    nodes: &'a Nodes,
    here: Node,
}

impl Kernel for Tangents<'_> {
    type Output = Vec<bool>;

    #[inline(always)]
    fn compute(self) -> Vec<bool> {
        let Self { nodes, here } = self;
        let mut is_tangent = vec![false; nodes.len()];
        let num = is_tangent.len();
        let [xs, zs, axs, azs, bxs, bzs] = nodes.columns.each_ref().map(|column| &column[..num]);
        for (i, is_tangent) in is_tangent.iter_mut().enumerate() {
            let there =
                Node { point_m: [xs[i], zs[i]], normals: [[axs[i], azs[i]], [bxs[i], bzs[i]]] };
            let leg = [xs[i] - here.point_m[0], zs[i] - here.point_m[1]];
            *is_tangent = here.is_tangent_along(leg) & there.is_tangent_along(leg.map(|v| -v));
        }
        is_tangent
    }
}
