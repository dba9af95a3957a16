//! Applying deltas, against a twin that edits the JSON tree directly.

use std::collections::BTreeSet;

use evonav_core::{
    Error,
    house::{AddedObject, House, HouseDelta, ObjectMove, StateChange},
};
use proptest::{collection::vec, option, prelude::*, sample::Index};
use serde_json::{Value, json};

const HOUSE: &str = include_str!("../data/house_39_objects.json");

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

fn entry<'a>(list: &'a mut Value, id: &str) -> Option<&'a mut Value> {
    let list = list.as_array_mut()?;
    list.iter_mut().find_map(|one| {
        if one["id"] == id { Some(one) } else { entry(one.get_mut("children")?, id) }
    })
}

/// Takes away empty lists of children that `before` does not have.
fn prune(list: &mut Value, before: &mut Value) {
    for object in list.as_array_mut().into_iter().flatten() {
        let id = object["id"].as_str().expect("an id").to_owned();
        let had = entry(before, &id).is_some_and(|old| old.get("children").is_some());
        if object.get("children").is_some_and(|below| below == &json!([])) && !had {
            object.as_object_mut().expect("an object").shift_remove("children");
        } else if let Some(below) = object.get_mut("children") {
            prune(below, before);
        }
    }
}

/// One change after the other on the document; `None` if a parent is in what moves, or something
/// stands on what is removed.
fn apply_naive(document: &Value, delta: &HouseDelta) -> Option<Value> {
    let (mut document, mut before) = (document.clone(), document.clone());
    for change in &delta.states {
        let holder = if change.id.starts_with("door|") { "doors" } else { "objects" };
        let object = entry(&mut document[holder], &change.id)?;
        if let Some(openness) = change.openness {
            object["openness"] = json!(openness);
        }
        if let Some(is_on) = change.is_on {
            object["isOn"] = json!(is_on);
        }
    }
    for step in &delta.moves {
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
    let mut left = delta.removed.clone();
    while !left.is_empty() {
        let before = left.len();
        left.retain(|id| {
            let is_bare = entry(&mut document["objects"], id).is_some_and(|object| {
                object.get("children").and_then(Value::as_array).is_none_or(Vec::is_empty)
            });
            if is_bare {
                take(document["objects"].as_array_mut().expect("a list"), id, None);
            }
            !is_bare
        });
        if left.len() == before {
            return None;
        }
    }
    for new in &delta.added {
        let ([x, y, z], [a, b, c]) = (new.position_m, new.rotation_deg);
        let made = json!({"id": new.id, "assetId": new.asset_id, "kinematic": false,
            "position": {"x": x, "y": y, "z": z}, "rotation": {"x": a, "y": b, "z": c}});
        let roots = document["objects"].as_array_mut()?;
        match &new.parent {
            None => roots,
            Some(parent) => children(roots, parent)?,
        }
        .push(made);
    }
    prune(&mut document["objects"], &mut before["objects"]);
    Some(document)
}

fn moves() -> impl Strategy<Value = Vec<(Index, [f64; 3], f64, Option<Index>)>> {
    let place = [0.0..10.0, 0.0..2.0, 0.0..10.0];
    vec((any::<Index>(), place, -180.0..180.0, option::of(any::<Index>())), 0..12)
}

proptest! {
    #[test]
    fn deltas_equal_edits_of_the_document(
        drawn in moves(),
        added in vec((option::of(any::<Index>()), 0.0..10.0), 0..4),
        removed in vec(any::<Index>(), 0..4),
        states in vec((any::<Index>(), option::of(0.0..=1.0), option::of(any::<bool>())), 0..4),
    ) {
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
        let removed: BTreeSet<String> = removed.into_iter().map(id).collect();
        for (number, (parent, x)) in added.into_iter().enumerate() {
            delta.added.push(AddedObject {
                id: format!("new|2|{number}"),
                asset_id: "Apple_1".to_owned(),
                position_m: [x, 0.5, 1.0],
                rotation_deg: [0.0, 10.0 * x, 0.0],
                // Every other one stands on the one before.
                parent: match number {
                    1 | 3 => Some(format!("new|2|{}", number - 1)),
                    _ => parent.map(id).filter(|parent| !removed.contains(parent)),
                },
            });
        }
        delta.removed = removed.into_iter().collect();
        for (index, openness, is_on) in states {
            let object = id(index);
            if !delta.removed.contains(&object) {
                delta.states.push(StateChange { id: object, openness, is_on });
            }
        }
        if let Some(door) = house.doors.first() {
            delta.states.push(StateChange { id: door.id.clone(), openness: Some(0.25), is_on: None });
        }
        delta = HouseDelta::from_json(&delta.to_json()).expect("what it wrote");
        let document: Value = serde_json::from_str(HOUSE).expect("valid JSON");
        match (house.apply(&delta), apply_naive(&document, &delta)) {
            (Ok(after), Some(expected)) => {
                prop_assert_eq!(after.to_json(), expected.to_string());
                let count = house.objects.len() + delta.added.len() - delta.removed.len();
                prop_assert_eq!(after.objects.len(), count);
                prop_assert_eq!(&after, &House::from_json("house", &expected.to_string()).expect("valid"));
            }
            (Err(Error::House { field, .. }), None) => {
                prop_assert!(field == "parent" || field == "children");
            }
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
        match house.apply(&HouseDelta { moves, ..HouseDelta::default() }) {
            Err(Error::House { field, .. }) => assert_eq!(field, expected),
            other => panic!("{expected}: {other:?}"),
        }
    }
    assert_eq!(house.apply(&HouseDelta::default()).expect("nothing to do"), house);
    let json = serde_json::to_string(&HouseDelta {
        moves: vec![step(&id, 1.0, None)],
        ..HouseDelta::default()
    })
    .expect("serialises");
    assert_eq!(HouseDelta::from_json(&json).expect("valid").moves, vec![step(&id, 1.0, None)]);
    assert!(matches!(
        HouseDelta::from_json("{\"moves\": [1]}"),
        Err(Error::InvalidArgument { .. })
    ));
}

#[test]
fn impossible_arrivals_departures_and_states_are_refused() {
    let house = House::from_json("house", HOUSE).expect("valid");
    let parent = house.objects.iter().find(|object| !object.children.is_empty()).expect("one");
    let child = &house.objects[parent.children[0]];
    let door = &house.doors[0].id;
    let delta = |json: Value| HouseDelta::from_json(&json.to_string()).expect("a delta");
    let new = |id: &str, parent: Value| {
        json!({"id": id, "asset_id": "Apple_1",
        "position_m": [1.0, 1.0, 1.0], "rotation_deg": [0.0, 0.0, 0.0], "parent": parent})
    };
    let cases = [
        (json!({"added": [new(&child.id, Value::Null)]}), &child.id[..], "id"),
        (json!({"added": [new("a", Value::Null), new("a", Value::Null)]}), "a", "id"),
        (json!({"added": [new(door, Value::Null)]}), door, "id"),
        (json!({"added": [new("a", json!("b")), new("b", Value::Null)]}), "a", "parent"),
        (json!({"removed": ["nothing"]}), "nothing", "id"),
        (json!({"removed": [child.id, child.id]}), &child.id, "id"),
        (json!({"removed": [parent.id]}), &parent.id, "children"),
        (json!({"states": [{"id": "nothing", "openness": 1.0}]}), "nothing", "id"),
        (json!({"states": [{"id": child.id, "openness": 1.5}]}), &child.id, "openness"),
        (json!({"states": [{"id": door, "openness": -0.1}]}), door, "openness"),
        (json!({"states": [{"id": door, "is_on": true}]}), door, "isOn"),
        (
            json!({"removed": [child.id], "states": [{"id": child.id, "is_on": true}]}),
            &child.id,
            "id",
        ),
    ];
    for (json, id, expected) in cases {
        match house.apply(&delta(json.clone())) {
            Err(Error::House { object, field, .. }) => {
                assert_eq!((object.as_str(), field.as_str()), (id, expected), "{json}");
            }
            other => panic!("{json}: {other:?}"),
        }
    }
    assert!(HouseDelta::from_json(r#"{"moves": [], "moved": []}"#).is_err());
    assert!(HouseDelta::from_json(r#"{"states": [{"id": "a", "isOn": true}]}"#).is_err());
}
