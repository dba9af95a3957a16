//! Rounding to the millimetre against decimal text.

use evonav_core::world::outlines::round_mm;
use proptest::prelude::*;

proptest! {
    /// Values on and beside ties are rounded as text is.
    #[test]
    fn rounding_is_that_of_decimal_text(
        value_m in prop_oneof![
            -100.0..100.0,
            (-200_000..200_000_i32).prop_map(|half_mm| f64::from(half_mm) / 2e3),
            (-2_000..2_000_i32).prop_map(|sixteenths| f64::from(sixteenths) / 16.0),
        ],
        is_next in any::<bool>(),
    ) {
        let value_m = if is_next { f64::next_up(value_m) } else { value_m };
        let text = format!("{value_m:.3}").parse::<f64>();
        prop_assert_eq!(Ok(round_mm(value_m).to_bits()), text.map(f64::to_bits));
    }
}
