//! Path data of polygons, in centimetres of a page.

use std::fmt::Write;

use crate::geometry::Vec2;

/// Coordinates from here on are not of a house.
const MAX_M: f64 = 1e7;

/// Return page coordinates of a point: x to the right, z up the page.
///
/// # Returns
/// Whole centimetres, halves rounded to even; the origin for a point that is not finite or not on
/// this planet.
pub fn page_cm([x_m, z_m]: Vec2) -> [i64; 2] {
    if x_m.abs() < MAX_M && z_m.abs() < MAX_M {
        [(100.0 * x_m).round_ties_even() as i64, (-100.0 * z_m).round_ties_even() as i64]
    } else {
        [0, 0]
    }
}

/// Return SVG path data of a closed polygon, relative and without needless separators.
///
/// # Arguments
/// * `polygon_m` - its corners, world frame.
///
/// # Returns
/// A dot for corners that all lie in the same centimetre; nothing without corners.
///
/// # Complexity
/// O(N) time.
pub fn outline(polygon_m: &[Vec2]) -> String {
    let mut corners = polygon_m.iter().copied().map(page_cm);
    let Some([mut x, mut y]) = corners.next() else { return String::new() };
    let mut data = format!("M{x} {y}");
    let start = data.len();
    for [next_x, next_y] in corners {
        // Writing to a string never fails.
        let _ = match (next_x - x, next_y - y) {
            (0, 0) => Ok(()),
            (dx, 0) => write!(data, "h{dx}"),
            (0, dy) => write!(data, "v{dy}"),
            (dx, dy) => write!(data, "l{dx} {dy}"),
        };
        [x, y] = [next_x, next_y];
    }
    data.push_str(if data.len() == start { "h0" } else { "z" });
    data
}
