//! Projection of sliced solids against sampled columns of the solids themselves.

use std::f64::consts::TAU;

use evonav_core::{
    assets::part::{Part, Primitive},
    geometry::{Vec2, Vec3, euler_rotation_deg, outline::distance_squared, sub},
    world::footprint::{convex_hull, footprint},
};
use proptest::prelude::*;

/// Whether a point is in a solid, from its definition; `grow` scales the solid.
fn contains_naive(part: &Part, point_m: Vec3, grow: f64) -> bool {
    let offset = sub(point_m, part.centre_m);
    let local: Vec3 = std::array::from_fn(|i| {
        (0..3).map(|j| part.rotation[j][i] * offset[j]).sum::<f64>() / grow
    });
    match part.primitive {
        Primitive::Cuboid { half_m } => (0..3).all(|i| local[i].abs() <= half_m[i]),
        Primitive::Frustum { bottom_m, top_m, half_height_m, sides } => {
            let t = 0.5 * (local[1] / half_height_m + 1.0);
            let half = [0, 1].map(|i| bottom_m[i] + t * (top_m[i] - bottom_m[i]));
            let unit = [local[0] / half[0], local[2] / half[1]];
            let step = TAU / f64::from(sides);
            // Inside a regular polygon: within its apothem towards every side.
            (0.0..=1.0).contains(&t)
                && (0..sides).all(|k| {
                    let (sin, cos) = ((f64::from(k) + 0.5) * step).sin_cos();
                    cos * unit[0] + sin * unit[1] <= (0.5 * step).cos()
                })
        }
        Primitive::Ellipsoid { .. } | Primitive::Pad { .. } => {
            unreachable!("drawn as polyhedra of their own")
        }
    }
}

fn arb_primitive() -> impl Strategy<Value = Primitive> {
    let cuboid = [0.05..1.0, 0.05..1.0, 0.05..1.0].prop_map(|half_m| Primitive::Cuboid { half_m });
    let frustum = ([0.1..1.0, 0.1..1.0], 0.2..1.5, 0.05..1.0, 3..20_u8).prop_map(
        |(bottom_m, taper, half_height_m, sides)| Primitive::Frustum {
            bottom_m,
            top_m: bottom_m.map(|v| v * taper),
            half_height_m,
            sides,
        },
    );
    prop_oneof![cuboid, frustum]
}

proptest! {
    /// A column that meets the solid inside the band stands in the footprint, and the other way
    /// round, but for a rim of what the samples cannot see.
    #[test]
    fn footprint_is_where_columns_meet_the_slice(
        primitive in arb_primitive(),
        angles_deg in [0.0..360.0, 0.0..360.0, 0.0..360.0],
        band in (-1.0..0.8, 0.02..1.0),
        points in prop::collection::vec([-1.5..1.5, -1.5..1.5], 40),
    ) {
        let rotation = euler_rotation_deg(angles_deg);
        let part = Part { primitive, centre_m: [0.1, 0.2, -0.1], rotation, colour: [0; 3], material: Default::default() };
        let (low_m, high_m) = (band.0, band.0 + band.1);
        let shadow = footprint(&part, low_m, high_m);
        for point in points {
            let column = (0..=400).map(|i| {
                [point[0], low_m + f64::from(i) / 400.0 * (high_m - low_m), point[1]]
            });
            let is_in = |grow| column.clone().any(|p| contains_naive(&part, p, grow));
            let gap_m = shadow.as_ref().map_or(f64::INFINITY, |s| distance_squared(&s.outline_m, point));
            prop_assert!(!is_in(1.0) || gap_m < 1e-12);
            prop_assert!(gap_m > 0.0 || is_in(1.1));
        }
    }

    /// All points lie in their hull, whose corners are points and turn left.
    #[test]
    fn hull_is_convex_and_holds_its_points(
        points in prop::collection::vec([-2..3_i8, -2..3_i8].prop_map(|p| p.map(f64::from)), 1..12),
    ) {
        let hull = convex_hull(points.clone());
        prop_assert!(hull.iter().all(|p| points.contains(p)));
        prop_assert!(points.iter().all(|&p: &Vec2| distance_squared(&hull, p) == 0.0));
        for i in 0..hull.len() {
            let [a, b, c] = [0, 1, 2].map(|k| hull[(i + k) % hull.len()]);
            let cross = (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0]);
            prop_assert!(hull.len() < 3 || cross > 0.0);
        }
    }
}
