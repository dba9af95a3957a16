//! Physics of changed houses, against the separating axis theorem and by hand.

use evonav_core::{
    assets::{
        Catalogue, UnknownAssets,
        part::{Part, Primitive},
    },
    geometry::{Vec3, add, euler_rotation_deg, rotate, sub},
    house::{House, HouseDelta, ObjectMove},
    world::{
        inspection::{Finding, FindingKind, Inspector, Tolerances, inspect_houses},
        scene::Scene,
    },
};
use proptest::prelude::*;

use crate::common::scenes::{cross, dot, scene_of};

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
        Primitive::Ellipsoid { .. } | Primitive::Pad { .. } => unreachable!("not asked for"),
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
        material: Default::default(),
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn depths_are_those_of_the_separating_axis_theorem(a in part(), b in part()) {
        let expected_m = depth_by_axes(&a, &b).max(0.0);
        let scene = scene_of(&[vec![a], vec![b]]);
        let found_m = Inspector::new(&scene).depth_m(0, 1);
        prop_assert!((found_m - expected_m).abs() < 1e-6, "found {found_m}, expected {expected_m}");
    }
}

const TOLERANCES: Tolerances = Tolerances { touch_m: 0.0025, rest_m: 0.02 };

fn recorded() -> House {
    House::from_json("house", include_str!("../data/house_100_objects.json"))
        .expect("a valid house")
}

fn findings(source: &House, stage: &House) -> Vec<Finding> {
    inspect_houses(source, stage, Catalogue::bundled(), UnknownAssets::Error, TOLERANCES)
        .expect("known assets")
}

/// Moves a root, with all that stands on it, by an offset.
fn shifted(house: &House, root: usize, offset_m: Vec3) -> House {
    let on_it = |&index: &usize| {
        std::iter::successors(Some(index), |&above| house.objects[above].parent).any(|i| i == root)
    };
    let moves = (0..house.objects.len()).filter(on_it).map(|index| {
        let object = &house.objects[index];
        ObjectMove {
            id: object.id.clone(),
            position_m: add(object.position_m, offset_m),
            rotation_deg: object.rotation_deg,
            parent: object.parent.map(|parent| house.objects[parent].id.clone()),
        }
    });
    house.apply(&HouseDelta { moves: moves.collect(), ..HouseDelta::default() }).expect("all known")
}

fn foreign(source: &House, stage: &House) -> Vec<(FindingKind, String)> {
    let found = findings(source, stage).into_iter().filter(|finding| !finding.is_own);
    found.map(|finding| (finding.kind, finding.id)).collect()
}

/// Whether flat-sided parts of two objects are deeper in each other than a touch.
fn overlap(house: &House, one: usize, other: usize) -> bool {
    let scene = Scene::build(house, Catalogue::bundled(), UnknownAssets::Error).expect("known");
    let parts = |object: usize| {
        let parts = scene.bodies[scene.first_object + object].parts.clone();
        parts.into_iter().filter(|part| !matches!(part.primitive, Primitive::Ellipsoid { .. }))
    };
    parts(one).any(|a| parts(other).any(|b| depth_by_axes(&a, &b) > TOLERANCES.touch_m))
}

#[test]
fn a_house_owns_what_it_has() {
    let house = recorded();
    assert!(findings(&house, &house).iter().all(|finding| finding.is_own));
}

#[test]
fn furniture_in_the_air_the_floor_and_other_furniture_is_found() {
    let house = recorded();
    let roots: Vec<usize> = (0..house.objects.len())
        .filter(|&i| house.objects[i].parent.is_none() && house.objects[i].position_m[1] < 0.6)
        .take(12)
        .collect();
    let mut num_touched = 0;
    for &root in &roots {
        let id = &house.objects[root].id;
        let raised = foreign(&house, &shifted(&house, root, [0.0, 0.3, 0.0]));
        assert!(raised.contains(&(FindingKind::Unsupported, id.clone())), "{id}: {raised:?}");
        let sunk = foreign(&house, &shifted(&house, root, [0.0, -0.1, 0.0]));
        assert!(sunk.contains(&(FindingKind::InFloor, id.clone())), "{id}: {sunk:?}");
        for &other in &roots {
            let apart = |i: usize| house.objects[i].position_m;
            if other == root {
                continue;
            }
            let mut offset_m = sub(apart(other), apart(root));
            offset_m[1] = 0.0;
            let stage = shifted(&house, root, offset_m);
            let touched = findings(&house, &stage).into_iter().any(|finding| {
                !finding.is_own
                    && finding.kind == FindingKind::Penetration
                    && [&finding.id, &finding.other_id].contains(&&house.objects[other].id)
            });
            assert!(
                touched || !overlap(&stage, root, other),
                "{id} at {}",
                house.objects[other].id
            );
            num_touched += usize::from(touched);
        }
        let away = foreign(&house, &shifted(&house, root, [50.0, 0.0, 0.0]));
        assert!(away.iter().all(|(kind, _)| *kind != FindingKind::Penetration), "{id}: {away:?}");
    }
    assert!(num_touched > 100, "{num_touched}");
}

#[test]
fn bad_tolerances_are_named() {
    let house = recorded();
    for (touch_m, rest_m, name) in [(-1.0, 0.0, "touch_m"), (0.0, f64::NAN, "rest_m")] {
        let tolerances = Tolerances { touch_m, rest_m };
        let catalogue = Catalogue::bundled();
        let refused = inspect_houses(&house, &house, catalogue, UnknownAssets::Error, tolerances);
        assert!(refused.unwrap_err().to_string().contains(name));
    }
}
