//! Convex outlines on the ground plane: overlap, distance, containment in a room.

use crate::geometry::{Vec2, polygon_contains};

/// Return the depth by which two convex outlines overlap, along the axis in which they overlap
/// least; negative where they are apart along the normal of an edge.
///
/// Two convex polygons are disjoint if and only if an edge normal of one of them separates them
/// (separating axis theorem), so the sign is exact; the value is the depth of penetration.
///
/// # Arguments
/// * `a`, `b` - convex outlines `[x, z]`, either orientation; empty ones are infinitely far apart.
pub fn overlap_m(a: &[Vec2], b: &[Vec2]) -> f64 {
    if a.is_empty() || b.is_empty() {
        return f64::NEG_INFINITY;
    }
    let mut least_m = f64::INFINITY;
    // Outlines of one or two points have no or one normal, so the two axes are tested as well.
    for normal in normals(a).chain(normals(b)).chain([[1.0, 0.0], [0.0, 1.0]]) {
        let ([a_low, a_high], [b_low, b_high]) = (extent(a, normal), extent(b, normal));
        least_m = least_m.min((a_high - b_low).min(b_high - a_low));
    }
    least_m
}

/// Return the unit normals of a polygon's edges; edges shorter than a nanometre have none.
fn normals(outline: &[Vec2]) -> impl Iterator<Item = Vec2> + '_ {
    let next = outline.iter().cycle().skip(1);
    outline.iter().zip(next).filter_map(|(p, q)| {
        let (x, z) = (q[0] - p[0], q[1] - p[1]);
        let length = x.hypot(z);
        (length > 1e-9).then(|| [z / length, -x / length])
    })
}

/// Return the smallest and largest coordinate along a direction.
fn extent(outline: &[Vec2], direction: Vec2) -> [f64; 2] {
    outline
        .iter()
        .map(|p| p[0] * direction[0] + p[1] * direction[1])
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| {
            [low.min(value), high.max(value)]
        })
}

/// Return the distance between two segments, 0 if they cross.
fn segment_distance_m(a: [Vec2; 2], b: [Vec2; 2]) -> f64 {
    let side = |s: [Vec2; 2], p: Vec2| {
        (s[1][0] - s[0][0]) * (p[1] - s[0][1]) - (s[1][1] - s[0][1]) * (p[0] - s[0][0])
    };
    if side(a, b[0]) * side(a, b[1]) < 0.0 && side(b, a[0]) * side(b, a[1]) < 0.0 {
        return 0.0;
    }
    let ends = [(a, b[0]), (a, b[1]), (b, a[0]), (b, a[1])];
    ends.iter().map(|&(s, p)| point_segment_m(p, s)).fold(f64::INFINITY, f64::min)
}

/// Return the distance of a point from a segment.
pub fn point_segment_m(point: Vec2, segment: [Vec2; 2]) -> f64 {
    let [a, b] = segment;
    let along = [b[0] - a[0], b[1] - a[1]];
    let squared = along[0] * along[0] + along[1] * along[1];
    let t = if squared > 0.0 {
        ((point[0] - a[0]) * along[0] + (point[1] - a[1]) * along[1]) / squared
    } else {
        0.0
    };
    let t = t.clamp(0.0, 1.0);
    (point[0] - a[0] - t * along[0]).hypot(point[1] - a[1] - t * along[1])
}

/// Return the edges of a closed polygon.
pub fn edges(polygon: &[Vec2]) -> impl Iterator<Item = [Vec2; 2]> + '_ {
    polygon.iter().zip(polygon.iter().cycle().skip(1)).map(|(&a, &b)| [a, b])
}

/// Return whether a convex outline lies in a simple polygon, at least `margin_m` from its border.
pub fn is_within(outline: &[Vec2], polygon: &[Vec2], margin_m: f64) -> bool {
    let is_off = |side: [Vec2; 2], wall: [Vec2; 2]| {
        let distance_m = segment_distance_m(side, wall);
        distance_m > 0.0 && distance_m >= margin_m
    };
    outline.first().is_some_and(|&p| polygon_contains(polygon, p))
        && edges(outline).all(|side| edges(polygon).all(|wall| is_off(side, wall)))
}

/// Return the smallest distance between the outlines' points; 0 if they overlap.
pub fn gap_m(a: &[Vec2], b: &[Vec2]) -> f64 {
    if a.is_empty() || b.is_empty() {
        return f64::INFINITY;
    }
    if overlap_m(a, b) >= 0.0 {
        return 0.0;
    }
    edges(a)
        .flat_map(|p| edges(b).map(move |q| segment_distance_m(p, q)))
        .fold(f64::INFINITY, f64::min)
}

/// Return the squared distance of a point from a convex polygon (0 inside), a segment or a point.
pub fn distance_squared(outline_m: &[Vec2], point_m: Vec2) -> f64 {
    let mut best = f64::INFINITY;
    let mut is_inside = outline_m.len() > 2;
    for (i, &a) in outline_m.iter().enumerate() {
        let b = outline_m[(i + 1) % outline_m.len()];
        let edge = [b[0] - a[0], b[1] - a[1]];
        let offset = [point_m[0] - a[0], point_m[1] - a[1]];
        // The nearest edge is one that has the point on its outer side.
        if outline_m.len() > 2 && edge[0] * offset[1] - edge[1] * offset[0] >= 0.0 {
            continue;
        }
        is_inside = false;
        let length_squared = edge[0] * edge[0] + edge[1] * edge[1];
        let t = ((edge[0] * offset[0] + edge[1] * offset[1]) / length_squared).clamp(0.0, 1.0);
        let t = if t.is_nan() { 0.0 } else { t };
        let gap = [offset[0] - t * edge[0], offset[1] - t * edge[1]];
        best = best.min(gap[0] * gap[0] + gap[1] * gap[1]);
    }
    if is_inside { 0.0 } else { best }
}
