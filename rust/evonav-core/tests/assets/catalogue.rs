//! The asset catalogue: what it holds, against the published database and recorded boxes.

use std::path::PathBuf;

use crate::common::recorded::data_set;
use evonav_core::{
    Error,
    assets::{Catalogue, UnknownAssets, placement_rule::Place},
    house::House,
};
use serde_json::Value;

const HOUSE: &str = include_str!("../data/house_100_objects.json");

fn read(path: PathBuf) -> Value {
    let text = std::fs::read_to_string(path).expect("readable");
    serde_json::from_str(&text).expect("valid JSON")
}

#[test]
fn catalogue_is_whole() {
    let catalogue = Catalogue::bundled();
    assert_eq!(catalogue.asset_ids().len(), 1653);
    assert_eq!(catalogue.categories().len(), 109);
    for id in catalogue.asset_ids() {
        let asset = catalogue.get(id).expect("listed");
        assert!(
            asset.size_m.iter().all(|edge| (0.001..10.0).contains(edge)),
            "{id} {:?}",
            asset.size_m
        );
        assert!(asset.surfaces_m.is_sorted(), "{id}");
        assert!(
            asset
                .surfaces_m
                .iter()
                .all(|&height| (0.0..=asset.size_m[1] + 0.001).contains(&height))
        );
        let is_structure =
            catalogue.placement(&asset.category).is_some_and(|rule| rule.is_structure);
        assert!(
            is_structure || !asset.colours.is_empty(),
            "{id} of {} has no colour",
            asset.category
        );
        assert!(
            asset.materials.iter().all(|name| catalogue.material_colour(name).is_some()),
            "{id}"
        );
        assert!(catalogue.assets_in(&asset.category).contains(&asset.id));
    }
    assert!(catalogue.get("no such asset").is_none());
    for category in catalogue.categories() {
        let median_m = catalogue.median_size_m(category).expect("listed");
        let sizes = catalogue.assets_in(category).iter().filter_map(|id| catalogue.get(id));
        for (axis, middle) in median_m.iter().enumerate() {
            let smaller = sizes.clone().filter(|asset| asset.size_m[axis] < *middle).count();
            let larger = sizes.clone().filter(|asset| asset.size_m[axis] > *middle).count();
            let half = catalogue.assets_in(category).len() / 2;
            assert!(smaller <= half && larger <= half, "{category} {median_m:?}");
        }
    }
}

#[test]
fn facts_are_procthors() {
    let catalogue = Catalogue::bundled();
    let bed = catalogue.get("Bed_1").expect("known");
    assert_eq!((bed.category.as_str(), bed.size_m), ("Bed", [1.4668, 0.9102, 2.0747]));
    assert!(bed.is_receptacle && bed.is_moveable && !bed.is_pickupable);
    // The mattress, well below the headboard that the box ends with.
    assert_eq!(bed.surfaces_m, [0.56]);
    // The figures of the data's own README.
    let dresser = catalogue.get("Dresser_209_1").expect("known");
    assert_eq!(dresser.surfaces_m, [0.074, 0.382, 0.697]);
    let rule = catalogue.placement("Bed").expect("annotated");
    assert_eq!(["Bedroom", "Kitchen"].map(|room| rule.room_weight(room)), [2.0, 0.0]);
    assert!(
        rule.is_placed(Place::Floor) && rule.is_placed(Place::Edge) && !rule.is_placed(Place::Wall)
    );
    assert!(catalogue.placement("Painting").expect("annotated").is_placed(Place::Wall));
    assert!(catalogue.can_rest_on("Book", "Desk") && !catalogue.can_rest_on("Bed", "Desk"));
    assert!(
        catalogue.rest_probability("Book", "Desk") > catalogue.rest_probability("Book", "Sofa")
    );
    assert_eq!(catalogue.material_colour("DrywallOrange"), Some([255, 147, 11]));
    assert_eq!(catalogue.material_colour("no such material"), None);
}

#[test]
fn sizes_equal_the_published_database() {
    let Some(path) = data_set("procthor-databases/asset-database.json") else { return };
    let catalogue = Catalogue::bundled();
    for published in read(path)
        .as_object()
        .expect("by category")
        .values()
        .flat_map(|v| v.as_array().expect("assets"))
    {
        let asset = catalogue.get(published["assetId"].as_str().expect("id")).expect("known");
        assert_eq!(Some(asset.category.as_str()), published["objectType"].as_str());
        for (edge_m, axis) in asset.size_m.iter().zip(["x", "y", "z"]) {
            let exact_m = published["boundingBox"][axis].as_f64().expect("number");
            assert!((edge_m - exact_m).abs() <= 0.000_051, "{} {axis}", asset.id);
        }
    }
}

/// World boxes of `ProcTHOR-10K` train[1], measured on the meshes by another simulator.
#[test]
fn boxes_match_a_recorded_scene() {
    let file = "piqiuni-molmospaces-procthor10k/procthor-10k_train_1_base_scene_full.json";
    let Some(path) = data_set(file) else { return };
    let catalogue = Catalogue::bundled();
    let mut errors_m = Vec::new();
    for record in read(path)["records"].as_array().expect("records") {
        let asset = catalogue.get(record["asset_id"].as_str().expect("id")).expect("known");
        let measured: Vec<f64> = record["aabb_size"]
            .as_array()
            .expect("size")
            .iter()
            .filter_map(Value::as_f64)
            .collect();
        // Dumped with z up; quarter turns swap the horizontal edges.
        let difference = |[x, z]: [f64; 2]| {
            let pairs = [(x, measured[0]), (z, measured[1]), (asset.size_m[1], measured[2])];
            pairs.iter().map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
        };
        let [x, _, z] = asset.size_m;
        errors_m.push(difference([x, z]).min(difference([z, x])));
    }
    errors_m.sort_by(f64::total_cmp);
    let median_m = errors_m[errors_m.len() / 2];
    eprintln!("{} boxes, worst edge off by {median_m:.4} m in the median", errors_m.len());
    assert!(errors_m.len() == 201 && median_m < 0.02, "{median_m}");
}

#[test]
fn unknown_assets_are_refused_or_sized_by_their_place() {
    let catalogue = Catalogue::bundled();
    let mut document: Value = serde_json::from_str(HOUSE).expect("valid JSON");
    let objects = document["objects"].as_array_mut().expect("objects");
    objects[0]["assetId"] = "08b0b11c1ffe4080b0b17418e65fb30c".into();
    objects[0]["objectType"] = "ObjaBookcase".into();
    objects[0]["position"]["y"] = 0.7.into();
    let house = House::from_json("house", &document.to_string()).expect("valid");
    let object = &house.objects[0];
    let Err(Error::House { object: id, field, message, .. }) =
        catalogue.asset_of(&house, object, UnknownAssets::Error)
    else {
        panic!("an unknown asset must be refused");
    };
    assert_eq!((id.as_str(), field.as_str()), (object.id.as_str(), "assetId"));
    assert!(message.contains("08b0b11c1ffe4080b0b17418e65fb30c"));
    assert!(message.contains("--assets") && message.contains("--allow-unknown-assets"));
    let asset =
        catalogue.asset_of(&house, object, UnknownAssets::CategoryDefault).expect("a default");
    assert_eq!(asset.category, "Bookcase");
    assert!((asset.size_m[1] - 1.4).abs() < 1e-12, "{:?}", asset.size_m);
    let known = house.objects.iter().find(|o| catalogue.get(&o.asset_id).is_some()).expect("one");
    let same = catalogue.asset_of(&house, known, UnknownAssets::Error).expect("known");
    assert_eq!(Some(&same), catalogue.get(&known.asset_id));
}

#[test]
fn a_house_may_give_the_sizes_of_assets_that_the_catalogue_lacks() {
    let catalogue = Catalogue::bundled();
    let mut document: Value = serde_json::from_str(HOUSE).expect("valid JSON");
    document["objects"][0]["assetId"] = "08b0b11c1ffe4080b0b17418e65fb30c".into();
    let own =
        serde_json::json!({"category": "Dresser", "size_m": [1.1, 0.9, 0.4], "receptacle": true});
    let known = document["objects"][1]["assetId"].as_str().expect("id").to_owned();
    document["metadata"]["evonav_assets"] =
        serde_json::json!({"08b0b11c1ffe4080b0b17418e65fb30c": own, known.as_str(): own});
    let house = House::from_json("house", &document.to_string()).expect("valid");
    let asset_of = |index: usize| {
        catalogue.asset_of(&house, &house.objects[index], UnknownAssets::Error).expect("known")
    };
    let asset = asset_of(0);
    assert_eq!((asset.category.as_str(), asset.size_m), ("Dresser", [1.1, 0.9, 0.4]));
    assert_eq!((asset.surfaces_m.as_slice(), asset.is_pickupable), (&[0.9][..], false));
    let other = house.objects.iter().find(|object| object.asset_id == known).expect("one");
    let same = catalogue.asset_of(&house, other, UnknownAssets::Error).expect("known");
    assert_eq!(Some(&same), catalogue.get(&known), "the catalogue's own facts come first");
    document["metadata"]["evonav_assets"]["08b0b11c1ffe4080b0b17418e65fb30c"]["size_m"][1] =
        (-0.9).into();
    let error = House::from_json("house", &document.to_string()).expect_err("a negative edge");
    let text = error.to_string();
    let field = "metadata.evonav_assets.08b0b11c1ffe4080b0b17418e65fb30c.size_m[1]";
    assert!(text.contains(field) && text.contains("-0.9"), "{text}");
}
