//! Applying deltas, against a twin that edits the JSON tree directly.

use std::collections::BTreeSet;

use evonav_core::{
    Error,
    house::{House, HouseDelta, ObjectMove},
};
use proptest::{collection::vec, option, prelude::*, sample::Index};
use serde_json::{Value, json};

const HOUSE: &str = include_str!("data/house_39_objects.json");

/// Takes the object out of the tree; with it, the id of what held it.
fn take(
    list: &mut Vec<Value>,
    id: &str,
    holder: Option<&str>,
) -> Option<(Value, Option<String>, usize)> {
    if let Some(index) = list.iter().position(|entry| entry["id"] == id) {
        return Some((list.remove(index), holder.map(str::to_owned), index));
    }
    list.iter_mut().find_map(|entry| {
        let own = entry["id"].as_str().map(str::to_owned);
        take(entry.get_mut("children")?.as_array_mut()?, id, own.as_deref())
    })
}

/// The list of children of `id`, made if it is not there.
fn children<'a>(list: &'a mut Vec<Value>, id: &str) -> Option<&'a mut Vec<Value>> {
    for entry in list {
        if entry["id"] == id {
            let fields = entry.as_object_mut()?;
            return fields.entry("children").or_insert(json!([])).as_array_mut();
        }
        if let Some(below) = entry.get_mut("children").and_then(Value::as_array_mut)
            && let Some(found) = children(below, id)
        {
            return Some(found);
        }
    }
    None
}

/// One move after the other on the document; `None` if a parent is in what moves.
fn apply_naive(document: &Value, moves: &[ObjectMove]) -> Option<Value> {
    let mut document = document.clone();
    for step in moves {
        let roots = document["objects"].as_array_mut()?;
        let (mut object, holder, index) = take(roots, &step.id, None)?;
        let [[x, y, z], [a, b, c]] = [step.position_m, step.rotation_deg];
        object["position"] = json!({"x": x, "y": y, "z": z});
        object["rotation"] = json!({"x": a, "y": b, "z": c});
        let list = match &step.parent {
            None => roots,
            Some(parent) => children(roots, parent)?,
        };
        let index = if holder == step.parent { index } else { list.len() };
        list.insert(index, object);
    }
    Some(document)
}

fn moves() -> impl Strategy<Value = Vec<(Index, [f64; 3], f64, Option<Index>)>> {
    let place = [0.0..10.0, 0.0..2.0, 0.0..10.0];
    vec((any::<Index>(), place, -180.0..180.0, option::of(any::<Index>())), 0..12)
}

proptest! {
    #[test]
    fn deltas_equal_edits_of_the_document(drawn in moves()) {
        let house = House::from_json("house", HOUSE).expect("valid");
        let id = |index: Index| house.objects[index.index(house.objects.len())].id.clone();
        let mut seen = BTreeSet::new();
        let mut delta = HouseDelta::default();
        for (index, position_m, yaw_deg, parent) in drawn {
            if seen.insert(id(index)) {
                let rotation_deg = [0.0, yaw_deg, 0.0];
                delta.moves.push(ObjectMove { id: id(index), position_m, rotation_deg, parent: parent.map(id) });
            }
        }
        let document: Value = serde_json::from_str(HOUSE).expect("valid JSON");
        match (house.apply(&delta), apply_naive(&document, &delta.moves)) {
            (Ok(after), Some(expected)) => {
                prop_assert_eq!(after.to_json(), expected.to_string());
                prop_assert_eq!(after.objects.len(), house.objects.len());
                prop_assert_eq!(&after, &House::from_json("house", &expected.to_string()).expect("valid"));
            }
            (Err(Error::House { field, .. }), None) => prop_assert_eq!(field, "parent"),
            (got, expected) => prop_assert!(false, "{got:?}, expected {expected:?}"),
        }
    }
}

#[test]
fn impossible_moves_are_refused() {
    let house = House::from_json("house", HOUSE).expect("valid");
    let id = house.objects[0].id.clone();
    let step = |id: &str, x: f64, parent: Option<&str>| ObjectMove {
        id: id.to_owned(),
        position_m: [x, 0.5, 1.0],
        rotation_deg: [0.0; 3],
        parent: parent.map(str::to_owned),
    };
    let cases = [
        (vec![step("nothing", 1.0, None)], "id"),
        (vec![step(&id, 1.0, None), step(&id, 2.0, None)], "id"),
        (vec![step(&id, f64::NAN, None)], "position"),
        (vec![step(&id, 1e9, None)], "position.x"),
        (vec![step(&id, 1.0, Some("nothing"))], "parent"),
        (vec![step(&id, 1.0, Some(&id))], "parent"),
    ];
    for (moves, expected) in cases {
        match house.apply(&HouseDelta { moves }) {
            Err(Error::House { field, .. }) => assert_eq!(field, expected),
            other => panic!("{expected}: {other:?}"),
        }
    }
    assert_eq!(house.apply(&HouseDelta::default()).expect("nothing to do"), house);
    let json = serde_json::to_string(&HouseDelta { moves: vec![step(&id, 1.0, None)] })
        .expect("serialises");
    assert_eq!(HouseDelta::from_json(&json).expect("valid").moves, vec![step(&id, 1.0, None)]);
    assert!(matches!(
        HouseDelta::from_json("{\"moves\": [1]}"),
        Err(Error::InvalidArgument { .. })
    ));
}
