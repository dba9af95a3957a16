//! Parts by their definition, for tests that look where something is.

use evonav_core::{
    assets::{
        Asset, Catalogue,
        part::{Part, Primitive},
    },
    geometry::{Vec3, sub},
};

/// Whether a point lies in a part, tested from the definition of each primitive.
pub fn holds(part: &Part, point_m: Vec3) -> bool {
    let offset = sub(point_m, part.centre_m);
    let own: Vec3 = std::array::from_fn(|j| (0..3).map(|i| part.rotation[i][j] * offset[i]).sum());
    match part.primitive {
        Primitive::Cuboid { half_m } => (0..3).all(|i| own[i].abs() <= half_m[i]),
        Primitive::Pad { .. } => unreachable!("only trim has pads"),
        Primitive::Ellipsoid { half_m } => {
            (0..3).map(|i| (own[i] / half_m[i]).powi(2)).sum::<f64>() <= 1.0
        }
        Primitive::Frustum { bottom_m, top_m, half_height_m, .. } => {
            let t = 0.5 * (own[1] / half_height_m + 1.0);
            let half = |i: usize| bottom_m[i] + t * (top_m[i] - bottom_m[i]);
            (0.0..=1.0).contains(&t)
                && (own[0] / half(0)).powi(2) + (own[2] / half(1)).powi(2) <= 1.0
        }
    }
}

/// Whether a point lies in any of some parts.
pub fn is_filled(parts: &[Part], point_m: Vec3) -> bool {
    parts.iter().any(|part| holds(part, point_m))
}

/// An asset of the catalogue.
pub fn asset(id: &str) -> Asset {
    Catalogue::bundled().get(id).expect("an asset of the catalogue").clone()
}
