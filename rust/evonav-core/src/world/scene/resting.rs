//! Let objects come to rest on their support.
//!
//! House files give the positions at which children were put down: about a quarter of the recorded
//! ones hover 5 cm over their surface, and members of asset groups (pillows) hang at the height of
//! the parent's box. AI2-THOR's physics lets them fall. Here they fall onto the parent's own shape.

use crate::{
    assets::part::{Part, Primitive},
    geometry::{Aabb, Vec2, Vec3},
};

/// Largest height of a support above the bottom of the box: recorded boxes dip into their support.
const DIP_M: f64 = 0.03;
/// Share of the way from the middle to the corners of a box at which supports are looked for,
/// besides the middle.
const CORNER: f64 = 0.7;

/// Return how far a box falls until it rests on one of `parts`.
///
/// A box beside all parts falls to the floor, y = 0, if the parts are `exact` and not guessed:
/// houses made without physics have objects over the free inside of corner counters. A box under or
/// between the parts stays, because something that the parts do not show must hold it.
pub(super) fn fall_m(parts: &[Part], aabb: &Aabb, exact: bool) -> f64 {
    let bottom_m = aabb.min_m[1];
    let [x, _, z] = aabb.centre_m();
    let [w, _, d] = aabb.size_m().map(|edge| 0.5 * CORNER * edge);
    let spots = [[x, z], [x - w, z - d], [x + w, z - d], [x - w, z + d], [x + w, z + d]];
    let tops = parts.iter().flat_map(|part| spots.iter().filter_map(|&spot| top_m(part, spot)));
    let (mut support_m, mut is_beside) = (f64::NEG_INFINITY, true);
    for top_m in tops {
        is_beside = false;
        if top_m <= bottom_m + DIP_M {
            support_m = support_m.max(top_m);
        }
    }
    if support_m.is_finite() {
        (bottom_m - support_m).max(0.0)
    } else if is_beside && exact {
        bottom_m.max(0.0)
    } else {
        0.0
    }
}

/// Return the height of a part's level top over a ground point; `None` if the point is beside the
/// part or the top is not level.
fn top_m(part: &Part, point_m: Vec2) -> Option<f64> {
    if part.rotation[1][1] < 0.999 {
        return None;
    }
    let offset = [point_m[0] - part.centre_m[0], 0.0, point_m[1] - part.centre_m[2]];
    let own: Vec3 = std::array::from_fn(|j| (0..3).map(|i| part.rotation[i][j] * offset[i]).sum());
    let (is_over, half_m) = match part.primitive {
        Primitive::Cuboid { half_m: [w, h, d] } | Primitive::Pad { half_m: [w, h, d], .. } => {
            (own[0].abs() <= w && own[2].abs() <= d, h)
        }
        Primitive::Frustum { top_m: [w, d], half_height_m, .. } => {
            ((own[0] / w).powi(2) + (own[2] / d).powi(2) <= 1.0, half_height_m)
        }
        Primitive::Ellipsoid { .. } => (false, 0.0),
    };
    is_over.then_some(part.centre_m[1] + half_m)
}
