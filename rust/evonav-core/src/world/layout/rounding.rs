//! Rounding of positions and yaws to short decimals, which are the same on every machine.

/// Step to which positions are rounded, and so the tolerance of containment.
pub const ROUND_M: f64 = 1e-4;
/// Step to which yaws are rounded.
pub const ROUND_DEG: f64 = 1e-3;

/// Round to the nearest multiple of `step`.
pub fn round_to(value: f64, step: f64) -> f64 {
    // Dividing by the reciprocal gives the exact decimal; multiplying by `step` does not.
    let per_unit = (1.0 / step).round();
    (value * per_unit).round() / per_unit
}

/// Bring an angle into 0..360 and round it.
pub fn turned_deg(angle_deg: f64) -> f64 {
    round_to(angle_deg.rem_euclid(360.0), ROUND_DEG) % 360.0
}
