//! Draws of clusters; `tests/statistics/test_resampling.py` holds them to NumPy's.

use evonav_core::resampling::{Pcg64, draw_counts};
use proptest::prelude::*;

/// Chances worked out for each draw, and drawn by walking along them.
fn draw_naive(source: &mut Pcg64, num: usize) -> Vec<u8> {
    let mut counts = vec![0; num];
    let (mut left, mut rest) = (num, 1.0);
    for (i, count) in counts.iter_mut().enumerate().take(num - 1) {
        let p = 1.0 / num as f64 / rest;
        let (p, is_other) = if p <= 0.5 { (p, false) } else { (1.0 - p, true) };
        let mut chance = (left as f64 * (-p).ln_1p()).exp();
        let mut u = source.uniform();
        let mut drawn = 0;
        while u > chance {
            drawn += 1;
            u -= chance;
            let x = drawn as f64;
            chance = (left as f64 - x + 1.0) * p * chance / (x * (1.0 - p));
        }
        let drawn = if is_other { left - drawn } else { drawn };
        *count = drawn as u8;
        left -= drawn;
        rest -= 1.0 / num as f64;
        if left == 0 || i + 2 == num {
            break;
        }
    }
    counts[num - 1] += left as u8;
    counts
}

proptest! {
    #[test]
    fn stored_chances_change_no_draw(state: u128, stream: u64, num in 1..300_usize) {
        let mut source = Pcg64 { state, increment: u128::from(stream) << 1 | 1 };
        let mut plain = source;
        let mut counts = vec![7; 20 * num];
        draw_counts(&mut source, &mut counts, num);
        for row in counts.chunks(num) {
            prop_assert_eq!(row, &draw_naive(&mut plain, num)[..]);
            prop_assert_eq!(row.iter().map(|&count| usize::from(count)).sum::<usize>(), num);
        }
        prop_assert_eq!(source, plain);
    }
}

#[test]
fn no_cluster_draws_nothing() {
    let mut source = Pcg64 { state: 1, increment: 1 };
    draw_counts(&mut source, &mut [], 0);
    assert_eq!(source, Pcg64 { state: 1, increment: 1 });
}
