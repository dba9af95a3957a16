//! Physics of changed houses, against the separating axis theorem and by hand.

use evonav_core::{
    assets::part::{Part, Primitive, aabb_of},
    geometry::{Aabb, Vec3, add, euler_rotation_deg, rotate, sub},
    world::{
        inspect::Inspector,
        scene::{Body, BodyKind, OrientedBox, Scene},
    },
};
use proptest::prelude::*;

fn scene_of(shapes: Vec<Vec<Part>>) -> Scene {
    let body = |(index, parts): (usize, Vec<Part>)| {
        let aabb = aabb_of(&parts);
        Body {
            id: format!("thing {index}"),
            category: "Thing".to_owned(),
            kind: BodyKind::Object,
            oriented: OrientedBox::of_aabb(&aabb),
            aabb,
            parts,
        }
    };
    let bodies: Vec<Body> = shapes.into_iter().enumerate().map(body).collect();
    Scene { bodies, first_object: 0, bounds: Aabb::EMPTY }
}

fn dot(a: Vec3, b: Vec3) -> f64 {
    (0..3).map(|i| a[i] * b[i]).sum()
}

fn cross(a: Vec3, b: Vec3) -> Vec3 {
    std::array::from_fn(|i| a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3])
}

/// Corners, face normals and edges of a part that is no ellipsoid.
fn polytope(part: &Part) -> (Vec<Vec3>, Vec<Vec3>, Vec<Vec3>) {
    let (lower, upper): (Vec<Vec3>, Vec<Vec3>) = match part.primitive {
        Primitive::Cuboid { half_m: [x, y, z] } => {
            let ring = |y| vec![[x, y, z], [-x, y, z], [-x, y, -z], [x, y, -z]];
            (ring(-y), ring(y))
        }
        Primitive::Frustum { bottom_m, top_m, half_height_m, sides } => (
            Primitive::ring_m(bottom_m, -half_height_m, sides).collect(),
            Primitive::ring_m(top_m, half_height_m, sides).collect(),
        ),
        Primitive::Ellipsoid { .. } => unreachable!("not asked for"),
    };
    let count = lower.len();
    let (mut normals, mut edges) = (vec![[0.0, 1.0, 0.0]], vec![]);
    for i in 0..count {
        let next = (i + 1) % count;
        let (along, up) = (sub(lower[next], lower[i]), sub(upper[i], lower[i]));
        normals.push(cross(along, up));
        edges.extend([along, up]);
    }
    let turned = |v: &Vec3| rotate(&part.rotation, *v);
    let corners = lower.iter().chain(&upper).map(|v| add(part.centre_m, turned(v))).collect();
    (corners, normals.iter().map(turned).collect(), edges.iter().map(turned).collect())
}

/// The shortest way out of each other: along a face's normal, or square to an edge of each.
fn depth_by_axes(a: &Part, b: &Part) -> f64 {
    let ((corners_a, normals_a, edges_a), (corners_b, normals_b, edges_b)) =
        (polytope(a), polytope(b));
    let crossed = edges_a.iter().flat_map(|e| edges_b.iter().map(|f| cross(*e, *f)));
    let axes: Vec<Vec3> = normals_a.iter().chain(&normals_b).copied().chain(crossed).collect();
    let mut least_m = f64::INFINITY;
    for axis in axes {
        let length = dot(axis, axis).sqrt();
        if length < 1e-9 {
            continue;
        }
        let extent = |corners: &[Vec3]| {
            corners
                .iter()
                .map(|&c| dot(c, axis) / length)
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
                    (low.min(v), high.max(v))
                })
        };
        let ((a_low, a_high), (b_low, b_high)) = (extent(&corners_a), extent(&corners_b));
        least_m = least_m.min(a_high - b_low).min(b_high - a_low);
    }
    least_m
}

fn part() -> impl Strategy<Value = Part> {
    let size = || prop::array::uniform3(prop_oneof![0.0025..0.02_f64, 0.02..1.0_f64]);
    let cuboid = size().prop_map(|half_m| Primitive::Cuboid { half_m });
    let frustum =
        (size(), 0.1..1.5_f64, 3_u8..9).prop_map(|([x, half_height_m, z], taper, sides)| {
            // Sides are planes, as those of all shapes.
            Primitive::Frustum {
                bottom_m: [x, z],
                top_m: [taper * x, taper * z],
                half_height_m,
                sides,
            }
        });
    let yaw = prop_oneof![Just(0.0), Just(90.0), 0.0..360.0_f64];
    let turn = (
        prop_oneof![3 => Just(0.0), 1 => -90.0..90.0_f64],
        yaw,
        prop_oneof![3 => Just(0.0), 1 => -90.0..90.0_f64],
    );
    let centre = prop::array::uniform3(-1.0..1.0_f64);
    (prop_oneof![cuboid, frustum], turn, centre).prop_map(|(primitive, (x, y, z), centre_m)| Part {
        primitive,
        centre_m,
        rotation: euler_rotation_deg([x, y, z]),
        colour: [0; 3],
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn depths_are_those_of_the_separating_axis_theorem(a in part(), b in part()) {
        let expected_m = depth_by_axes(&a, &b).max(0.0);
        let scene = scene_of(vec![vec![a], vec![b]]);
        let found_m = Inspector::new(&scene).depth_m(0, 1);
        prop_assert!((found_m - expected_m).abs() < 1e-6, "found {found_m}, expected {expected_m}");
    }
}
