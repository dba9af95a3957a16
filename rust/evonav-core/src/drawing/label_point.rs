//! The place in a room where its name stands best.

use crate::geometry::{
    Vec2, bounds_2d_m, distance_2d_m,
    outline::{edges, point_segment_m},
    polygon_contains,
};

/// A box `[left, low, right, high]` in metres.
pub type Rect = [f64; 4];

/// Return where in a polygon a label stands best: over little, and far from the edges.
///
/// Tries the middles of `num * num` cells of the polygon's box, row by row from the smallest z;
/// of equal places the first.
///
/// # Arguments
/// * `polygon_m` - the room, world frame.
/// * `num` - places tried, along each axis.
/// * `taken_m` - boxes that the label should not cover.
/// * `size_m` - width and height of the label; a label of no width covers nothing.
///
/// # Returns
/// The place, right to about a `num`-th of the polygon's size; the first one tried where none is
/// inside, and NaN without corners or places.
///
/// # Complexity
/// O(num^2 (N + B)) time for N corners and B boxes.
pub fn label_point(polygon_m: &[Vec2], num: usize, taken_m: &[Rect], size_m: Vec2) -> Vec2 {
    let [low, high] = bounds_2d_m(polygon_m.iter().copied());
    let sum = polygon_m.iter().fold([0.0; 2], |a, b| [a[0] + b[0], a[1] + b[1]]);
    let middle = sum.map(|total| total / polygon_m.len() as f64);
    let place = |axis: usize, step: usize| {
        let share = (step as f64 + 0.5) / num as f64;
        low[axis] + share * (high[axis] - low[axis])
    };
    let covers = !taken_m.is_empty() && size_m[0] > 0.0;
    let half = size_m.map(|edge_m| edge_m / 2.0);
    let mut best = [place(0, 0), place(1, 0)];
    let mut highest = f64::NEG_INFINITY;
    for index in 0..num * num {
        let point = [place(0, index % num), place(1, index / num)];
        let mut score = f64::NEG_INFINITY;
        if polygon_contains(polygon_m, point) {
            let gaps_m = edges(polygon_m).map(|edge| point_segment_m(point, edge));
            let gap_m = gaps_m.fold(f64::INFINITY, f64::min);
            // Among points that are about as good, the one nearest to the middle looks right.
            score = gap_m - 0.15 * distance_2d_m(point, middle);
            if covers {
                let covered: f64 = taken_m.iter().map(|taken| overlap_m2(point, half, taken)).sum();
                let covered = covered / (size_m[0] * size_m[1]);
                // A label that reaches over an edge is as bad as one over furniture.
                let reach =
                    (half[1] - gap_m).max(0.0) / half[1] + (half[0] - gap_m).max(0.0) / half[0];
                score = 0.3 * score - 2.0 * covered - 0.5 * reach;
            }
        }
        if score > highest {
            (highest, best) = (score, point);
        }
    }
    best
}

/// Return the area that a label around a point shares with a box.
fn overlap_m2(point: Vec2, half: Vec2, taken: &Rect) -> f64 {
    let side = |axis: usize| {
        let high = (point[axis] + half[axis]).min(taken[axis + 2]);
        (high - (point[axis] - half[axis]).max(taken[axis])).max(0.0)
    };
    side(0) * side(1)
}
