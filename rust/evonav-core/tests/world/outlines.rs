//! Plan geometry against twins that only ask where points are.

use std::f64::consts::TAU;

use evonav_core::geometry::{
    Vec2,
    outline::{gap_m, is_within, overlap_m},
    polygon_contains,
};
use proptest::{collection::vec, prelude::*};

/// A convex outline: points of an ellipse, in order.
fn outline() -> impl Strategy<Value = Vec<Vec2>> {
    let shape = ([-2.0..2.0, -2.0..2.0], [0.2..1.5, 0.2..1.5], vec(0.0..TAU, 3..8));
    shape.prop_map(|(centre, half, mut angles): (Vec2, Vec2, Vec<f64>)| {
        angles.sort_by(f64::total_cmp);
        angles
            .iter()
            .map(|a| [centre[0] + half[0] * a.cos(), centre[1] + half[1] * a.sin()])
            .collect()
    })
}

fn mixed(a: Vec2, b: Vec2) -> impl Iterator<Item = Vec2> {
    (0..=20)
        .map(|i| f64::from(i) / 20.0)
        .map(move |t| [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])])
}

/// Points of a polygon's sides.
fn border_of(outline: &[Vec2]) -> Vec<Vec2> {
    let next = outline.iter().cycle().skip(1);
    outline.iter().zip(next).flat_map(|(&a, &b)| mixed(a, b)).collect()
}

/// Points of a convex outline's sides and of the segments to them from a corner: all of it.
fn points_of(outline: &[Vec2]) -> Vec<Vec2> {
    border_of(outline).into_iter().flat_map(|p| mixed(outline[0], p)).collect()
}

fn shifted(outline: &[Vec2], by: Vec2) -> Vec<Vec2> {
    outline.iter().map(|p| [p[0] + by[0], p[1] + by[1]]).collect()
}

proptest! {
    /// A point in both is an overlap; no overlap has no such point. The depth is how far one has
    /// to be pushed: in no direction less.
    #[test]
    fn overlap_is_what_shared_points_say(a in outline(), b in outline(), angle in 0.0..TAU) {
        let depth_m = overlap_m(&a, &b);
        prop_assert!((depth_m - overlap_m(&b, &a)).abs() < 1e-12);
        let shares = |other: &[Vec2]| points_of(&a).iter().any(|&p| polygon_contains(other, p));
        if shares(&b) {
            prop_assert!(depth_m >= 0.0, "{depth_m}");
        }
        if depth_m > 0.0 {
            let push = |m: f64| shifted(&b, [m * angle.cos(), m * angle.sin()]);
            prop_assert!(overlap_m(&a, &push(0.999 * depth_m)) > 0.0);
        }
    }

    /// The distance of the nearest sampled points bounds the gap from above, tightly.
    #[test]
    fn gap_is_the_distance_of_the_nearest_points(a in outline(), b in outline()) {
        let gap = gap_m(&a, &b);
        let (a_points, b_points) = (border_of(&a), border_of(&b));
        let nearest = a_points
            .iter()
            .flat_map(|p| b_points.iter().map(move |q| (p[0] - q[0]).hypot(p[1] - q[1])))
            .fold(f64::INFINITY, f64::min);
        prop_assert!(gap <= nearest + 1e-12);
        prop_assert!(gap > 0.0 || overlap_m(&a, &b) >= 0.0);
        // Samples of a side of at most 3 m are at most 0.15 m apart.
        prop_assert!(gap == 0.0 || nearest <= gap + 0.16, "{gap} {nearest}");
    }

    /// In an L-shaped room: an outline is within it if and only if all its points are, and stays
    /// so under any push of up to the margin.
    #[test]
    fn within_a_room_is_with_every_point(a in outline(), margin_m in 0.0..0.3, angle in 0.0..TAU) {
        let room = [[-3.0, -3.0], [3.0, -3.0], [3.0, 0.5], [0.5, 0.5], [0.5, 3.0], [-3.0, 3.0]];
        let push = [0.999 * margin_m * angle.cos(), 0.999 * margin_m * angle.sin()];
        if is_within(&a, &room, margin_m) {
            let pushed = points_of(&shifted(&a, push));
            prop_assert!(pushed.iter().all(|&p| polygon_contains(&room, p)));
        } else if is_within(&a, &room, 0.0) {
            // Then some push of the margin crosses the border.
            let crosses = (0..360).map(f64::from).any(|degrees| {
                let (sin, cos) = degrees.to_radians().sin_cos();
                let far = 1.01 * margin_m + 1e-6;
                !is_within(&shifted(&a, [far * cos, far * sin]), &room, 0.0)
            });
            prop_assert!(crosses);
        }
    }
}

#[test]
fn outlines_of_one_or_two_points_are_told_apart() {
    let point = [[0.0, 0.0]];
    let segment = [[1.0, -1.0], [1.0, 1.0]];
    assert!((overlap_m(&point, &segment) + 1.0).abs() < 1e-12);
    assert!((gap_m(&point, &segment) - 1.0).abs() < 1e-12);
    assert_eq!(gap_m(&point, &[]), f64::INFINITY);
    assert_eq!(overlap_m(&point, &point), 0.0);
}
