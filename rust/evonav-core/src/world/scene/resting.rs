//! What stands on something comes to rest on it.
//!
//! House files keep where children were when they were put down: about a quarter of the recorded
//! ones hover 5 cm over their surface, and members of asset groups (pillows) hang at the height of
//! the parent's box. AI2-THOR's physics lets them fall; so do we, onto the parent's own shape.

use crate::{
    assets::part::{Part, Primitive},
    geometry::{Aabb, Vec2, Vec3},
};

/// A support this little above the bottom is still one: recorded boxes dip into what holds them.
const DIP_M: f64 = 0.03;
/// Where under a box supports are looked for: its middle, and this far towards its corners.
const CORNER: f64 = 0.7;

/// How far a box falls until it rests on one of `parts`.
///
/// Beside them all (houses made without physics hang things over the free inside of corner
/// counters) it falls to the floor, y = 0, if the parts are `exact` and not guessed. Under or between
/// them, where something that the parts do not show must hold it, it stays.
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

/// Height of a part's level top over a ground point; `None` beside it, or where it is not level.
fn top_m(part: &Part, point_m: Vec2) -> Option<f64> {
    if part.rotation[1][1] < 0.999 {
        return None;
    }
    let offset = [point_m[0] - part.centre_m[0], 0.0, point_m[1] - part.centre_m[2]];
    let own: Vec3 = std::array::from_fn(|j| (0..3).map(|i| part.rotation[i][j] * offset[i]).sum());
    let (is_over, half_m) = match part.primitive {
        Primitive::Cuboid { half_m: [w, h, d] } => (own[0].abs() <= w && own[2].abs() <= d, h),
        Primitive::Frustum { top_m: [w, d], half_height_m, .. } => {
            ((own[0] / w).powi(2) + (own[2] / d).powi(2) <= 1.0, half_height_m)
        }
        Primitive::Ellipsoid { .. } => (false, 0.0),
    };
    is_over.then_some(part.centre_m[1] + half_m)
}
