//! Path data, walked along again.

use evonav_core::{drawing::outline::outline, geometry::Vec2};
use proptest::{collection::vec, prelude::*};

/// Page coordinates, with halves rounded to even by hand.
fn cm_naive(metres: f64) -> i64 {
    let (low, rest) = ((100.0 * metres).floor(), (100.0 * metres) - (100.0 * metres).floor());
    let low = low as i64;
    match rest.partial_cmp(&0.5) {
        Some(std::cmp::Ordering::Less) => low,
        Some(std::cmp::Ordering::Greater) => low + 1,
        _ => low + low.rem_euclid(2),
    }
}

/// The corners that path data goes to, letter by letter.
fn walked(data: &str) -> Vec<[i64; 2]> {
    let mut at = [0, 0];
    let mut corners = Vec::new();
    let letters: Vec<usize> = data.match_indices(char::is_alphabetic).map(|(i, _)| i).collect();
    for (n, &start) in letters.iter().enumerate() {
        let end = letters.get(n + 1).copied().unwrap_or(data.len());
        let numbers: Vec<i64> = data[start + 1..end]
            .split_whitespace()
            .map(|word| word.parse().expect("a number"))
            .collect();
        match (&data[start..=start], &numbers[..]) {
            ("M", &[x, y]) => at = [x, y],
            ("h", &[dx]) => at[0] += dx,
            ("v", &[dy]) => at[1] += dy,
            ("l", &[dx, dy]) => at = [at[0] + dx, at[1] + dy],
            ("z", []) => break,
            _ => panic!("{data}"),
        }
        corners.push(at);
    }
    corners
}

proptest! {
    #[test]
    fn the_path_goes_to_every_corner(polygon_m in vec([-9.0..9.0, -9.0..9.0_f64], 1..9), steps in 1..400_u32) {
        // Coarse steps put corners into the same place, on lines, and halfway between centimetres.
        let step = f64::from(steps) / 200.0;
        let round = |value: f64| (value / step).round() * step;
        let polygon_m: Vec<Vec2> = polygon_m.iter().map(|&[x, z]| [round(x), round(z)]).collect();
        let mut expected: Vec<[i64; 2]> =
            polygon_m.iter().map(|&[x, z]| [cm_naive(x), cm_naive(-z)]).collect();
        expected.dedup();
        let data = outline(&polygon_m);
        if expected.len() == 1 {
            prop_assert!(data.ends_with("h0"), "{data}");
            expected.push(expected[0]);
        } else {
            prop_assert!(data.ends_with('z'), "{data}");
        }
        prop_assert_eq!(walked(&data), expected);
    }
}

#[test]
fn places_off_the_planet_are_the_origin() {
    assert_eq!(outline(&[]), "");
    assert_eq!(outline(&[[f64::NAN, 1.0], [2.0, f64::INFINITY], [1e8, 0.0]]), "M0 0h0");
}
