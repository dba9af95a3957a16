//! Rounding of places: short decimals, the same on every machine.

/// Rounding of places, and so the slack of containment.
pub const ROUND_M: f64 = 1e-4;
/// Rounding of yaws.
pub const ROUND_DEG: f64 = 1e-3;

/// The nearest multiple of `step`: places are short decimals, the same on every machine.
pub fn round_to(value: f64, step: f64) -> f64 {
    // Dividing by the reciprocal gives the decimal itself where multiplying by `step` does not.
    let per_unit = (1.0 / step).round();
    (value * per_unit).round() / per_unit
}

/// An angle in 0..360, rounded.
pub fn turned_deg(angle_deg: f64) -> f64 {
    round_to(angle_deg.rem_euclid(360.0), ROUND_DEG) % 360.0
}
