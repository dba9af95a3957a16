//! Shapes that open, and that light up.

use std::collections::BTreeMap;

use evonav_core::{
    assets::{
        Asset, Catalogue,
        part::{Part, aabb_of},
        shapes::{drawn_openness, shape_in, shape_of, shows_light},
    },
    house::Condition,
};
use proptest::prelude::*;

use crate::common::solids::{asset, is_filled};

fn at(asset: &Asset, openness: f64) -> Vec<Part> {
    shape_in(asset, Condition { openness: Some(openness), is_on: None })
}

#[test]
fn what_opens_is_what_ai2_thor_opens_and_what_has_drawers() {
    let catalogue = Catalogue::bundled();
    let mut counts: BTreeMap<&str, [usize; 2]> = BTreeMap::new();
    for id in catalogue.asset_ids() {
        let asset = catalogue.get(id).expect("listed");
        if let Some(drawn) = drawn_openness(asset) {
            counts.entry(&asset.category).or_default()[0] += 1;
            // In the state in which it is drawn anyway, all parts of that drawing are there; a box
            // gets flaps.
            if asset.category != "Box" {
                let all = at(asset, drawn);
                assert!(shape_of(asset).iter().all(|part| all.contains(part)), "{id}");
            }
        }
        counts.entry(&asset.category).or_default()[1] += 1;
    }
    for category in
        ["Fridge", "Laptop", "Box", "Microwave", "Safe", "Toilet", "WashingMachine", "ClothesDryer"]
    {
        assert_eq!(counts[category][0], counts[category][1], "{category}: all of them open");
    }
    for category in ["Dresser", "Desk"] {
        assert!(counts[category][0] > 0, "{category}: some have drawers");
    }
    for category in ["Bed", "Chair", "Sofa", "DiningTable", "Apple", "Painting", "FloorLamp"] {
        assert_eq!(counts[category][0], 0, "{category}: nothing opens");
    }
}

#[test]
fn a_closed_door_is_where_an_open_one_is_not() {
    let fridge = asset("Fridge_1");
    let [w, _, d] = fridge.size_m;
    let (closed, open) = (at(&fridge, 0.0), at(&fridge, 1.0));
    let in_front = [0.0, -0.1, 0.5 * d - 0.08];
    assert!(is_filled(&closed, in_front) && !is_filled(&open, in_front));
    let swung = [0.5 * w - 0.02, -0.1, 0.5 * d - 0.06 + 0.5 * w];
    assert!(!is_filled(&closed, swung) && is_filled(&open, swung), "hinged on its right");
    assert!(aabb_of(&open).max_m[2] > 0.5 * d + 0.8 * w);

    let laptop = asset("Laptop_1");
    let [_, h, _] = laptop.size_m;
    assert!(aabb_of(&at(&laptop, 0.0)).max_m[1] < -0.5 * h + 0.06, "closed, it is flat");
    assert!((aabb_of(&at(&laptop, 1.0)).max_m[1] - 0.5 * h).abs() < 1e-6);

    let carton = Catalogue::bundled().assets_in("Box")[0].clone();
    let carton = asset(&carton);
    let [_, h, d] = carton.size_m;
    let flap_m = (0.5 * d).min(0.4 * h);
    let over = [0.0, 0.5 * h - flap_m - 0.002, 0.5 * d - 0.5 * flap_m];
    assert!(is_filled(&at(&carton, 0.0), over) && !is_filled(&at(&carton, 1.0), over));
    assert!(!is_filled(&shape_of(&carton), over), "as ever where the file is silent");
}

#[test]
fn lamps_and_screens_show_that_they_are_on() {
    let catalogue = Catalogue::bundled();
    for category in ["FloorLamp", "DeskLamp", "Television"] {
        for id in catalogue.assets_in(category) {
            let asset = asset(id);
            assert!(shows_light(&asset), "{id}");
            let off = shape_in(&asset, Condition { openness: None, is_on: Some(false) });
            assert_eq!(off, shape_of(&asset));
        }
    }
    assert!(!shows_light(&asset("Fridge_1")));
}

proptest! {
    /// Whatever opens moves rigidly: parts keep their sizes, and move a little for a little.
    #[test]
    fn opening_is_a_rigid_motion(from in 0.001..0.999, step in 0.0005..0.001) {
        let catalogue = Catalogue::bundled();
        for id in catalogue.asset_ids() {
            let asset = catalogue.get(id).expect("listed");
            if drawn_openness(asset).is_none() {
                continue;
            }
            let (before, after) = (at(asset, from), at(asset, from + step));
            prop_assert_eq!(before.len(), after.len());
            let reach_m = asset.size_m.iter().map(|edge| edge * edge).sum::<f64>().sqrt();
            for (one, other) in before.iter().zip(&after) {
                prop_assert_eq!(one.primitive, other.primitive);
                let moved_m = (0..3).map(|i| (one.centre_m[i] - other.centre_m[i]).powi(2)).sum::<f64>().sqrt();
                prop_assert!(moved_m <= 2.0 * reach_m * step, "{} {moved_m}", id);
            }
        }
    }
}
