//! What a body covers of the ground plane, seen by an agent of some height.

use crate::{
    assets::part::{Part, Primitive},
    geometry::{Vec2, Vec3, add, rotate},
};

/// Rings and segments an ellipsoid is cut into: 2% of a half axis at most.
const ELLIPSOID_RINGS: usize = 8;
const ELLIPSOID_SIDES: usize = 16;
/// Points nearer than this are one.
const MERGE_M: f64 = 1e-9;

/// The part of a convex solid between two heights, projected to the ground.
#[derive(Debug, Clone, PartialEq)]
pub struct Footprint {
    /// Convex outline `[x, z]` with the interior on the left of each edge (x turns towards z);
    /// one point or two for solids that are thinner than a nanometre.
    pub outline_m: Vec<Vec2>,
    /// Lowest height of the solid inside the band.
    pub bottom_m: f64,
    /// Highest.
    pub top_m: f64,
}

/// Projects what a part has between the heights `low_m` and `high_m`; `None` if nothing.
///
/// Exact for cuboids and frustums in any rotation; an ellipsoid is taken as the polyhedron of
/// [`Primitive::Ellipsoid`]'s latitude-longitude net, inside it by at most 2% of a half axis.
pub fn footprint(part: &Part, low_m: f64, high_m: f64) -> Option<Footprint> {
    let (corners, edges) = polyhedron(&part.primitive);
    let corners: Vec<Vec3> =
        corners.iter().map(|&c| add(rotate(&part.rotation, c), part.centre_m)).collect();
    let mut shadow: Vec<Vec2> = Vec::with_capacity(corners.len());
    let (mut bottom_m, mut top_m) = (f64::INFINITY, f64::NEG_INFINITY);
    let mut keep = |point: Vec3| {
        shadow.push([point[0], point[2]]);
        bottom_m = bottom_m.min(point[1]);
        top_m = top_m.max(point[1]);
    };
    for &corner in corners.iter().filter(|c| (low_m..=high_m).contains(&c[1])) {
        keep(corner);
    }
    // The band's faces cut the solid along polygons whose corners lie on its edges.
    for &(i, j) in &edges {
        let (a, b) = (corners[i], corners[j]);
        for height in [low_m, high_m] {
            if (a[1] < height) != (b[1] < height) {
                let t = (height - a[1]) / (b[1] - a[1]);
                keep([a[0] + t * (b[0] - a[0]), height, a[2] + t * (b[2] - a[2])]);
            }
        }
    }
    (!shadow.is_empty()).then(|| Footprint { outline_m: convex_hull(shadow), bottom_m, top_m })
}

/// Convex hull, counter-clockwise when x turns towards z, collinear points left out.
pub fn convex_hull(mut points: Vec<Vec2>) -> Vec<Vec2> {
    points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    points.dedup_by(|a, b| (a[0] - b[0]).abs() < MERGE_M && (a[1] - b[1]).abs() < MERGE_M);
    if points.len() < 3 {
        return points;
    }
    let mut hull: Vec<Vec2> = Vec::with_capacity(points.len() + 1);
    for is_upper in [false, true] {
        let floor = hull.len() + 1;
        for i in 0..points.len() {
            let point = points[if is_upper { points.len() - 1 - i } else { i }];
            while hull.len() > floor && is_right_or_straight(&hull, point) {
                hull.pop();
            }
            hull.push(point);
        }
        hull.pop(); // The last point of a chain is the first of the other.
    }
    hull
}

/// Whether going on to `point` turns right, or left by less than a nanometre.
fn is_right_or_straight(hull: &[Vec2], point: Vec2) -> bool {
    let [.., a, b] = hull else { return false };
    let along = [point[0] - a[0], point[1] - a[1]];
    let cross = along[0] * (b[1] - a[1]) - along[1] * (b[0] - a[0]);
    cross >= -MERGE_M * along[0].hypot(along[1])
}

/// Corners and edges of a primitive, its own frame.
fn polyhedron(primitive: &Primitive) -> (Vec<Vec3>, Vec<(usize, usize)>) {
    match *primitive {
        Primitive::Cuboid { half_m: h } => {
            let sign = |i: usize, bit: usize| if i >> bit & 1 == 1 { 1.0 } else { -1.0 };
            let corners = (0..8).map(|i| [sign(i, 0) * h[0], sign(i, 1) * h[1], sign(i, 2) * h[2]]);
            let edges = (0..8_usize)
                .flat_map(|i| [1, 2, 4].map(|bit| (i, i | bit)))
                .filter(|(i, j)| i != j);
            (corners.collect(), edges.collect())
        }
        Primitive::Frustum { bottom_m, top_m, half_height_m, sides } => {
            let sides = usize::from(sides.max(3));
            let rings = [(bottom_m, -half_height_m), (top_m, half_height_m)];
            net(&rings, sides)
        }
        Primitive::Ellipsoid { half_m } => {
            let rings: Vec<([f64; 2], f64)> = (0..=ELLIPSOID_RINGS)
                .map(|i| {
                    let latitude = std::f64::consts::PI * (i as f64 / ELLIPSOID_RINGS as f64 - 0.5);
                    let (sin, cos) = latitude.sin_cos();
                    ([half_m[0] * cos, half_m[2] * cos], half_m[1] * sin)
                })
                .collect();
            net(&rings, ELLIPSOID_SIDES)
        }
    }
}

/// Rings of `sides` corners at given heights, joined along the rings and upwards.
fn net(rings: &[([f64; 2], f64)], sides: usize) -> (Vec<Vec3>, Vec<(usize, usize)>) {
    let mut corners = Vec::with_capacity(rings.len() * sides);
    let mut edges = Vec::with_capacity(2 * rings.len() * sides);
    for (ring, &(half_m, height_m)) in rings.iter().enumerate() {
        for side in 0..sides {
            let angle = std::f64::consts::TAU * side as f64 / sides as f64;
            corners.push([half_m[0] * angle.cos(), height_m, half_m[1] * angle.sin()]);
            edges.push((ring * sides + side, ring * sides + (side + 1) % sides));
            if ring > 0 {
                edges.push((ring * sides + side, (ring - 1) * sides + side));
            }
        }
    }
    (corners, edges)
}
