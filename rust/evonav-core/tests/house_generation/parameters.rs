//! Parameters from files: each mistake is named, and none makes the maker panic or hang.

use evonav_core::{
    Error,
    house_generation::{HouseMaker, HouseParameters},
    rng::Stream,
};
use serde_json::{Value, json};

#[test]
fn the_default_is_read_back() {
    let parameters = HouseParameters::default();
    assert_eq!(HouseParameters::from_json(&parameters.to_json()).unwrap(), parameters);
    assert_eq!(HouseParameters::from_json("{}").unwrap(), parameters);
}

#[test]
fn mistakes_are_named() {
    let room = |fields: Value| json!({"room_specs": [{"id": "a", "weight": 1, "rooms": [fields]}]});
    for (document, field) in [
        (json!({"building": {}}), "building"),
        (json!({"structure": {"cell": 3}}), "structure"),
        (json!({"structure": {"cell_m": [2.0, 1.5]}}), "structure.cell_m"),
        (json!({"structure": {"num_candidates": 0}}), "structure.num_candidates"),
        (json!({"doors": {"open_probability": 1.5}}), "doors.open_probability"),
        (json!({"floor_objects": {"max_per_room": [[3, 0.0]]}}), "floor_objects.max_per_room"),
        (json!({"floor_objects": {"priority": {"Kitchen": ["Oven"]}}}), "floor_objects.priority"),
        (
            json!({"floor_objects": {"lying": {"BaseballBat": -1}}}),
            "floor_objects.lying.BaseballBat",
        ),
        (json!({"hung": {"televisions": ["Bed_1"]}}), "hung.televisions"),
        (json!({"appearance": {"skies": {}}}), "appearance.skies"),
        (json!({"appearance": {"skies": {"noon": []}}}), "appearance"),
        (json!({"room_specs": []}), "room_specs"),
        (room(json!({"ratio": 1})), "room_specs[0].rooms[0]"),
        (room(json!({"ratio": 0, "type": "Kitchen"})), "room_specs[0].rooms[0].ratio"),
        (
            room(json!({"ratio": 1, "rooms": [{"ratio": 1, "type": ""}]})),
            "room_specs[0].rooms[0].rooms[0].type",
        ),
        (room(json!({"ratio": 1, "size": 2, "type": "Kitchen"})), "room_specs"),
        (json!({"split": "dev"}), "split"),
        (json!([]), "parameters"),
    ] {
        match HouseParameters::from_json(&document.to_string()) {
            Err(Error::InvalidArgument { name, .. }) => assert_eq!(name, field, "{document}"),
            other => panic!("{document}: {other:?}"),
        }
    }
}

/// Change one value of a document at random: a number, a word, a list or a key.
fn mutate(value: &mut Value, stream: &mut Stream) {
    match value {
        Value::Object(fields) if !fields.is_empty() && stream.uniform() < 0.93 => {
            let key = fields.keys().nth(stream.below(fields.len())).unwrap().clone();
            if stream.uniform() < 0.04 {
                fields.remove(&key);
            } else {
                mutate(&mut fields[&key], stream);
            }
        }
        Value::Array(items) if !items.is_empty() && stream.uniform() < 0.93 => {
            let index = stream.below(items.len());
            if stream.uniform() < 0.04 {
                items.remove(index);
            } else {
                mutate(&mut items[index], stream);
            }
        }
        Value::Number(number) if stream.uniform() < 0.8 => {
            let factor = [0.0, 0.5, 0.9, 1.1, 2.0, -1.0, 1e12][stream.below(7)];
            let changed = number.as_f64().unwrap_or(1.0) * factor;
            *value = if number.is_f64() { json!(changed) } else { json!(changed as i64) };
        }
        _ => {
            let others = [json!(null), json!(3), json!(0.5), json!("Bed"), json!([]), json!({})];
            *value = others[stream.below(others.len())].clone();
        }
    }
}

#[test]
fn mutated_parameters_give_houses_or_named_errors() {
    let default: Value = serde_json::from_str(&HouseParameters::default().to_json()).unwrap();
    let (mut num_refused, mut num_made) = (0, 0);
    for number in 0..1000 {
        let mut stream = Stream::new(number, &["mutation"]);
        let mut document = default.clone();
        for _ in 0..1 + stream.below(3) {
            mutate(&mut document, &mut stream);
        }
        match HouseParameters::from_json(&document.to_string()) {
            Err(Error::InvalidArgument { name, .. }) => {
                num_refused += 1;
                assert!(!name.is_empty());
            }
            Err(other) => panic!("{number}: {other}"),
            Ok(mut parameters) => {
                // Few tries: what is hard to furnish is given up soon.
                parameters.max_structures = parameters.max_structures.min(3);
                parameters.structure.num_candidates = parameters.structure.num_candidates.min(20);
                match HouseMaker::new(parameters).unwrap().make(number, 0) {
                    Ok(_) => num_made += 1,
                    Err(Error::Simulation { message }) => assert!(message.contains("room spec")),
                    Err(other) => panic!("{number}: {other}"),
                }
            }
        }
    }
    assert!(num_refused > 100 && num_made > 100, "{num_refused} refused, {num_made} made");
}
