//! Shapes of all catalogue assets: exact boxes, sane parts, free room where there should be some.

use std::collections::BTreeSet;

use evonav_core::{
    assets::{
        Asset, Catalogue,
        part::{Part, Primitive, aabb_of},
        shapes::{Shape, shape_of, trimmed_shape},
    },
    geometry::Aabb,
    house::Condition,
};
use proptest::prelude::*;

use crate::common::solids::{asset, is_filled};

/// Triangles that tessellation makes of a part (ellipsoids: 12 meridians, 6 bands).
fn num_triangles(part: &Part) -> usize {
    match part.primitive {
        Primitive::Cuboid { .. } => 12,
        Primitive::Frustum { sides, .. } => 4 * usize::from(sides) - 4,
        Primitive::Ellipsoid { .. } => 120,
        Primitive::Pad { .. } => 60,
    }
}

fn is_sane(parts: &[Part]) -> bool {
    let positive = |edges: &[f64]| edges.iter().all(|edge| edge.is_finite() && *edge > 0.0);
    parts.iter().all(|part| match part.primitive {
        Primitive::Cuboid { half_m } | Primitive::Ellipsoid { half_m } => positive(&half_m),
        Primitive::Pad { half_m, cut_m } => positive(&half_m) && positive(&[cut_m]),
        Primitive::Frustum { bottom_m, top_m, half_height_m, sides } => {
            positive(&bottom_m) && positive(&top_m) && positive(&[half_height_m]) && sides >= 3
        }
    })
}

#[test]
fn every_asset_fills_its_box_and_nothing_else() {
    let catalogue = Catalogue::bundled();
    let ids = catalogue.asset_ids();
    assert_eq!(ids.len(), 1653);
    let mut costliest = (0, "");
    for id in ids {
        let asset = catalogue.get(id).expect("listed");
        let parts = shape_of(asset);
        assert!(!parts.is_empty() && is_sane(&parts), "{id}");
        let bounds = aabb_of(&parts);
        for axis in 0..3 {
            let half = 0.5 * asset.size_m[axis];
            assert!((bounds.max_m[axis] - half).abs() < 1e-6, "{id} {bounds:?} {half}");
            assert!((bounds.min_m[axis] + half).abs() < 1e-6, "{id} {bounds:?} {half}");
        }
        costliest = costliest.max((parts.iter().map(num_triangles).sum(), id));
    }
    assert!(costliest.0 <= 700, "{costliest:?}");
}

#[test]
fn trim_lies_in_the_box_of_its_asset() {
    let catalogue = Catalogue::bundled();
    let mut num_trimmed = 0;
    for id in catalogue.asset_ids() {
        let asset = catalogue.get(id).expect("listed");
        let Shape { parts, trim } = trimmed_shape(asset, Condition::default());
        assert_eq!(parts, shape_of(asset), "{id}");
        assert!(parts.iter().all(|part| !matches!(part.primitive, Primitive::Pad { .. })), "{id}");
        assert!(is_sane(&trim), "{id}");
        num_trimmed += usize::from(!trim.is_empty());
        let bounds = aabb_of(&trim);
        for axis in 0..3 {
            let half = 0.5 * asset.size_m[axis] + 1e-6;
            assert!(bounds.max_m[axis] <= half && bounds.min_m[axis] >= -half, "{id} {bounds:?}");
        }
        assert!(trim.iter().map(num_triangles).sum::<usize>() <= 1500, "{id}");
    }
    assert!(num_trimmed > 150, "{num_trimmed}");
}

/// Categories that are recognised by parts too small or too soft to bump into.
const TRIMMED: [&str; 16] = [
    "ArmChair",
    "BasketBall",
    "Bed",
    "Book",
    "Chair",
    "CounterTop",
    "DiningTable",
    "DogBed",
    "Fridge",
    "HousePlant",
    "Laptop",
    "Pillow",
    "Sink",
    "Sofa",
    "Television",
    "Toilet",
];

#[test]
fn trim_lies_on_the_solid_parts_of_its_asset() {
    const TOLERANCE_M: f64 = 0.03;
    let catalogue = Catalogue::bundled();
    let assets = catalogue.asset_ids().into_iter().filter_map(|id| catalogue.get(id));
    let mut trimmed = BTreeSet::new();
    for asset in assets.filter(|asset| TRIMMED.contains(&asset.category.as_str())) {
        for openness in [None, Some(0.0), Some(1.0)] {
            let Shape { parts, trim } = trimmed_shape(asset, Condition { openness, is_on: None });
            if !trim.is_empty() {
                trimmed.insert(asset.category.as_str());
            }
            let solids: Vec<Aabb> = parts.iter().map(Part::aabb).collect();
            for part in trim {
                let bounds = part.aabb();
                let touches = |solid: &Aabb| {
                    (0..3).all(|i| {
                        bounds.min_m[i] <= solid.max_m[i] + TOLERANCE_M
                            && bounds.max_m[i] >= solid.min_m[i] - TOLERANCE_M
                    })
                };
                assert!(solids.iter().any(touches), "{} {openness:?}: {part:?}", asset.id);
            }
        }
    }
    assert!(trimmed.iter().eq(TRIMMED.iter()), "{trimmed:?}");
}

#[test]
fn corner_counters_leave_their_inside_free() {
    let inner = |id: &str, x: f64, z: f64| {
        let asset = asset(id);
        let [w, h, d] = asset.size_m;
        is_filled(&shape_of(&asset), [x * w, 0.3 * h, z * d])
    };
    assert!(!inner("Countertop_L_10x10", -0.3, 0.3));
    assert!(inner("Countertop_L_10x10", 0.4, 0.3) && inner("Countertop_L_10x10", -0.3, -0.45));
    assert!(!inner("Countertop_C_8x10", 0.0, 0.3));
    assert!(inner("Countertop_C_8x10", -0.45, 0.3) && inner("Countertop_C_8x10", 0.45, 0.3));
    assert!(inner("Countertop_I_4x2", 0.0, 0.0) && inner("Countertop_Island_6x3", 0.0, 0.0));
}

#[test]
fn there_is_room_under_tables_and_chairs_but_not_in_their_tops() {
    for id in ["Dining_Table_201_1", "Dining_Table_7_1", "RoboTHOR_desk_lisabo", "Stool_1_1"] {
        let asset = asset(id);
        let h = asset.size_m[1];
        let parts = shape_of(&asset);
        assert!(is_filled(&parts, [0.0, 0.5 * h - 0.01, 0.0]), "{id}: top");
        let quarter = [-0.25 * asset.size_m[0], -0.1 * h, 0.25 * asset.size_m[2]];
        assert!(!is_filled(&parts, quarter), "{id}: room underneath");
    }
    let chair = asset("Chair_203_1");
    let [_, h, d] = chair.size_m;
    let parts = shape_of(&chair);
    assert!(!is_filled(&parts, [0.0, 0.4 * h, 0.2 * d]), "nothing above the seat");
    assert!(is_filled(&parts, [0.0, 0.49 * h, -0.49 * d]), "the back is at -z");
}

#[test]
fn the_same_asset_always_looks_the_same() {
    let catalogue = Catalogue::bundled();
    for id in catalogue.asset_ids() {
        let asset = catalogue.get(id).expect("listed");
        assert_eq!(shape_of(asset), shape_of(asset));
    }
}

proptest! {
    /// Every category at any size, with any surfaces and colours, fills its box.
    #[test]
    fn odd_sizes_still_fill_their_box(
        size_m in [0.002..4.0, 0.002..4.0, 0.002..4.0],
        surfaces_m in proptest::collection::vec(-1.0..3.0, 0..6),
        colours in proptest::collection::vec(any::<[u8; 3]>(), 0..3),
        id in "[A-Za-z_]{0,8}",
    ) {
        let others = ["Bathtub", "Bookcase", "ConsoleTable", "Nothing"];
        for category in Catalogue::bundled().categories().into_iter().chain(others) {
            let asset = Asset {
                id: id.clone(),
                category: category.to_owned(),
                size_m,
                surfaces_m: surfaces_m.clone(),
                colours: colours.clone(),
                ..Asset::default()
            };
            let parts = shape_of(&asset);
            prop_assert!(is_sane(&parts), "{asset:?}");
            let bounds = aabb_of(&parts);
            for (axis, edge) in size_m.into_iter().enumerate() {
                prop_assert!((bounds.max_m[axis] - 0.5 * edge).abs() < 1e-6, "{asset:?}");
                prop_assert!((bounds.min_m[axis] + 0.5 * edge).abs() < 1e-6, "{asset:?}");
            }
        }
    }
}
