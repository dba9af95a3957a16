//! Broken houses: always a house or a typed error, at once.

use std::time::{Duration, Instant};

use evonav_core::{
    Error,
    assets::{Catalogue, UnknownAssets},
    house::{House, HouseDelta},
    world::{
        navigation::{AgentBody, Navigation, NavigationConfig},
        scene::Scene,
    },
};
use proptest::{collection::vec, prelude::*, sample::Index};
use serde_json::{Value, json};

const HOUSES: [&str; 2] =
    [include_str!("../data/house_39_objects.json"), include_str!("../data/house_100_objects.json")];

/// JSON pointers of everything in the document.
fn pointers(value: &Value, here: &str, all: &mut Vec<String>) {
    all.push(here.to_owned());
    match value {
        Value::Array(list) => {
            list.iter()
                .enumerate()
                .for_each(|(i, entry)| pointers(entry, &format!("{here}/{i}"), all));
        }
        Value::Object(map) => {
            map.iter().for_each(|(key, entry)| pointers(entry, &format!("{here}/{key}"), all));
        }
        _ => {}
    }
}

fn nested(value: &Value, depth: usize) -> Value {
    (0..depth).fold(value.clone(), |inner, _| json!([inner]))
}

/// Changes one place in one way.
fn mutate(document: &mut Value, place: Index, way: usize, other: Index) {
    let mut all = Vec::new();
    pointers(document, "", &mut all);
    // Places with '/' or '~' in their keys do not exist in houses; pointers are exact.
    let pointer = all[place.index(all.len())].clone();
    let elsewhere = document.pointer(&all[other.index(all.len())]).cloned().unwrap_or(Value::Null);
    let Some(target) = document.pointer_mut(&pointer) else { return };
    match way {
        0 => *target = Value::Null,
        1 => *target = json!("NaN"),
        2 => *target = json!(1e308),
        3 => *target = json!(-1e-308),
        4 => *target = json!(u64::MAX),
        5 => *target = json!([]),
        6 => *target = json!({}),
        7 => *target = json!(true),
        8 => *target = json!("x".repeat(5000)),
        9 => *target = nested(target, 60),
        10 => *target = elsewhere,
        11 => *target = json!(-3.7),
        12 => *target = json!("room|exterior|wall|é"),
        _ => remove(document, &pointer, way),
    }
}

/// Drops, doubles or renames the entry.
fn remove(document: &mut Value, pointer: &str, way: usize) {
    let Some((holder, key)) = pointer.rsplit_once('/') else { return };
    match document.pointer_mut(holder) {
        Some(Value::Object(map)) => {
            if let Some(value) = map.shift_remove(key)
                && way == 14
            {
                map.insert(format!("{key}2"), value);
            }
        }
        Some(Value::Array(list)) => {
            let Ok(index) = key.parse::<usize>() else { return };
            if way == 13 {
                list.remove(index);
            } else {
                list.push(list[index].clone());
            }
        }
        _ => {}
    }
}

/// Changes the text itself.
fn damage(text: &str, place: Index, way: usize) -> String {
    let mut at = place.index(text.len());
    while !text.is_char_boundary(at) {
        at -= 1;
    }
    let (before, after) = text.split_at(at);
    let insert = ["", "NaN", "1e999", "-Infinity", "{", "]", "\"", "\u{0}", "\\u", ",", "00"];
    match way % 13 {
        0 => before.to_owned(),
        11 => format!("{before}{}{after}", "[".repeat(100_000)),
        12 => format!("{before}{}{after}", "{\"children\":".repeat(10_000)),
        other => format!("{before}{}{after}", insert[other]),
    }
}

/// What is read can be built, stood in and mapped without a panic.
fn check_world(house: &House) -> Result<(), TestCaseError> {
    let scene = Scene::build(house, Catalogue::bundled(), UnknownAssets::CategoryDefault);
    let scene = scene.map_err(|error| TestCaseError::fail(error.to_string()))?;
    let agent = AgentBody { radius_m: 0.2, height_m: 1.8 };
    if let Ok(navigation) = Navigation::build(&scene, agent, NavigationConfig::default()) {
        let corner_m = house.rooms[0].polygon_m[0];
        if let Some(free_m) = navigation.snap(corner_m) {
            prop_assert!(navigation.is_free(free_m));
        }
        let spec = navigation.map_spec(0.25);
        let cells = spec.and_then(|spec| navigation.occupancy(&spec, corner_m));
        prop_assert!(cells.is_ok_and(|cells| cells.len() < 4_000_000));
    }
    Ok(())
}

/// What must hold of any text.
fn check(json: &str) -> Result<bool, TestCaseError> {
    let start = Instant::now();
    let outcome = House::from_json("broken.jsonl:7", json);
    prop_assert!(start.elapsed() < Duration::from_secs(5), "took {:?}", start.elapsed());
    match &outcome {
        Ok(house) => {
            let again = House::from_json("broken.jsonl:7", &house.to_json());
            prop_assert_eq!(again.as_ref(), Ok(house));
            let unchanged = house.apply(&HouseDelta::default());
            prop_assert_eq!(unchanged.as_ref(), Ok(house));
            check_world(house)?;
            for object in &house.objects {
                let unknown = UnknownAssets::CategoryDefault;
                let asset =
                    Catalogue::bundled().asset_of(house, object, unknown).expect("a default");
                let sane = 0.0005..20.0;
                prop_assert!(asset.size_m.iter().all(|edge| sane.contains(edge)), "{asset:?}");
            }
        }
        Err(Error::House { house, object, field, message }) => {
            prop_assert_eq!(house, "broken.jsonl:7");
            prop_assert!(![object, field, message].iter().any(|text| text.is_empty()));
            prop_assert!(message.len() < 2000, "{}", message.len());
        }
        Err(error) => prop_assert!(false, "{error:?}"),
    }
    Ok(outcome.is_ok())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(600))]

    #[test]
    fn changed_documents_are_read_or_refused(
        which in 0..2_usize,
        changes in vec((any::<Index>(), 0..16_usize, any::<Index>()), 1..4),
    ) {
        let mut document: Value = serde_json::from_str(HOUSES[which]).expect("valid JSON");
        for (place, way, other) in changes {
            mutate(&mut document, place, way, other);
        }
        check(&document.to_string())?;
    }

    #[test]
    fn damaged_text_is_read_or_refused(which in 0..2_usize, place in any::<Index>(), way in 0..13_usize) {
        check(&damage(HOUSES[which], place, way))?;
    }
}

#[test]
fn each_way_is_refused_somewhere() {
    let small: Value = serde_json::from_str(HOUSES[0]).expect("valid JSON");
    let mut all = Vec::new();
    pointers(&small, "", &mut all);
    let objects = all
        .iter()
        .filter(|pointer| pointer.starts_with("/objects/0/") || pointer.starts_with("/rooms/0/"));
    let mut num_refused = 0;
    for pointer in objects.filter(|pointer| !pointer.contains("/layer")) {
        let mut document = small.clone();
        *document.pointer_mut(pointer).expect("there") = json!({"wrong": "type"});
        num_refused += usize::from(!check(&document.to_string()).expect("a typed outcome"));
    }
    assert!(num_refused > 20, "{num_refused}");
}

#[test]
fn bombs_are_refused() {
    let open = "[".repeat(1_000_000);
    let children = "{\"id\":\"a\",\"assetId\":\"b\",\"children\":[".repeat(100_000);
    let wide = format!("{{\"metadata\":{{}},\"rooms\":[{}]}}", "{},".repeat(1_000_000));
    for text in ["", " ", "nul", "0", "[]", "{}", "\"house\"", &open, &children, &wide] {
        assert!(!check(text).expect("a typed outcome"), "{text:.40}");
    }
    let mut crowded: Value = serde_json::from_str(HOUSES[0]).expect("valid JSON");
    let object = crowded["objects"][0].clone();
    crowded["objects"] = Value::Array(vec![object; 10_000]);
    assert!(!check(&crowded.to_string()).expect("a typed outcome"));
}
