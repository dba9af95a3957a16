//! Places of labels in rectangular rooms, where every distance is a difference.

use evonav_core::{
    drawing::label_point::{Rect, label_point},
    geometry::Vec2,
};
use proptest::{collection::vec, option, prelude::*};

const NUM: usize = 9;

/// How good a place is, as the kernel's sentence says it.
fn score_naive([x, z]: Vec2, room: [f64; 2], taken: &[Rect], size: Option<Vec2>) -> f64 {
    let gap = x.min(room[0] - x).min(z).min(room[1] - z);
    let score = gap - 0.15 * (x - room[0] / 2.0).hypot(z - room[1] / 2.0);
    let Some([width, height]) = size.filter(|_| !taken.is_empty()) else { return score };
    let mut covered = 0.0;
    for [left, low, right, high] in taken {
        let shared = |at: f64, edge: f64, from: f64, to: f64| {
            let (start, end) = (f64::max(at - edge / 2.0, from), f64::min(at + edge / 2.0, to));
            if end > start { end - start } else { 0.0 }
        };
        covered += shared(x, width, *left, *right) * shared(z, height, *low, *high);
    }
    let beyond = |edge: f64| if gap < edge / 2.0 { 1.0 - gap / (edge / 2.0) } else { 0.0 };
    0.3 * score - 2.0 * covered / (width * height) - 0.5 * (beyond(width) + beyond(height))
}

proptest! {
    #[test]
    fn no_other_place_is_better(
        room in [1.0..8.0, 1.0..8.0_f64],
        boxes in vec([0.0..6.0, 0.0..6.0, 0.1..3.0, 0.1..3.0_f64], 0..12),
        size in option::of([0.2..2.0, 0.1..0.6_f64]),
        is_reversed in any::<bool>(),
    ) {
        let mut polygon_m = [[0.0, 0.0], [0.0, room[1]], room, [room[0], 0.0]];
        if is_reversed {
            polygon_m.reverse();
        }
        let taken: Vec<Rect> = boxes.iter().map(|&[x, z, w, d]| [x, z, x + w, z + d]).collect();
        let found = label_point(&polygon_m, NUM, &taken, size.unwrap_or_default());
        let place = |axis: usize, step: usize| (step as f64 + 0.5) / NUM as f64 * room[axis];
        let places = (0..NUM * NUM).map(|i| [place(0, i % NUM), place(1, i / NUM)]);
        let best = places.clone().map(|at| score_naive(at, room, &taken, size)).fold(f64::MIN, f64::max);
        prop_assert!(score_naive(found, room, &taken, size) >= best - 1e-9);
        prop_assert!(places.into_iter().any(|at| (at[0] - found[0]).hypot(at[1] - found[1]) < 1e-9));
    }
}

#[test]
fn a_label_stands_inside_of_a_bent_room() {
    let room = [[0.0, 0.0], [0.0, 4.0], [1.0, 4.0], [1.0, 1.0], [4.0, 1.0], [4.0, 0.0]];
    let [x, z] = label_point(&room, 24, &[], [0.0; 2]);
    assert!(x < 1.0 || z < 1.0, "{x} {z}");
    assert!(label_point(&[], 24, &[], [0.0; 2])[0].is_nan());
}
