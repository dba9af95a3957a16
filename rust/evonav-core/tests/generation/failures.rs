//! Rooms that cannot take their modification: what is recorded, and that trying again helps.

use super::tasks::{always, generate};
use evonav_core::{
    generation::{
        Mode, Parameters,
        record::{EvolutionOutcome, EvolutionRecord, GeneratedTask, ModificationFailure},
    },
    house::House,
};
use serde_json::Value;

const HOUSE: &str = include_str!("../data/house_100_objects.json");

/// Failures of a task's transitions; the house must be the same where there is one.
fn failures(task: &GeneratedTask) -> Vec<Option<ModificationFailure>> {
    let check = |(k, record): (usize, &EvolutionRecord)| {
        let has_failed = record.outcome == EvolutionOutcome::NoPlacement;
        assert_eq!(record.failure.is_some(), has_failed);
        assert_eq!(record.changes.is_empty(), has_failed);
        assert!(!has_failed || task.houses[k] == task.houses[k + 1]);
        assert!(record.room_id.is_some() && record.mode.is_some());
        record.failure
    };
    let records = task.stages.iter().skip(1).map(|stage| &stage.evolution);
    records.enumerate().map(check).collect()
}

#[test]
fn no_place_is_free_where_every_place_is_too_near() {
    let house = House::from_json("house", HOUSE).unwrap();
    for mode in [Mode::SalientObject, Mode::RetainGroup] {
        let parameters = Parameters { relocated_min_m: 1e6, ..always(mode, 3) };
        let found = failures(&generate(&house, 0, &parameters));
        assert_eq!(found, [Some(ModificationFailure::NoFreePlace); 2], "{mode:?}");
    }
}

#[test]
fn nothing_moves_where_everything_hangs_on_walls() {
    let mut document: Value = serde_json::from_str(HOUSE).unwrap();
    for object in document["objects"].as_array_mut().unwrap() {
        object["position"]["y"] = Value::from(object["position"]["y"].as_f64().unwrap() + 0.3);
        object["children"] = Value::Array(vec![]);
    }
    let house = House::from_json("hung", &document.to_string()).unwrap();
    for mode in Mode::ALL {
        let parameters = Parameters { goals_on_walls: true, ..always(mode, 3) };
        let found = failures(&generate(&house, 0, &parameters));
        assert_eq!(found, [Some(ModificationFailure::NothingMovable); 2], "{mode:?}");
    }
}

#[test]
fn a_room_is_tried_again_before_it_is_given_up() {
    let house = House::from_json("house", HOUSE).unwrap();
    // Few draws, and all of them must be far: many rooms fail, and fewer with more tries.
    let num_failures = |modification_tries| {
        let parameters = Parameters {
            placement_tries: 1,
            relocated_min_m: 4.0,
            modification_tries,
            num_stages: vec![2],
            ..always(Mode::RetainGroup, 3)
        };
        let tasks = (0..40).map(|seed| generate(&house, seed, &parameters));
        let drawn: Vec<(Option<String>, bool)> = tasks
            .map(|task| (task.stages[1].evolution.room_id.clone(), failures(&task)[0].is_some()))
            .collect();
        let rooms: Vec<Option<String>> = drawn.iter().map(|(room, _)| room.clone()).collect();
        (rooms, drawn.iter().filter(|(_, has_failed)| *has_failed).count())
    };
    let ((rooms, once), (same_rooms, often)) = (num_failures(1), num_failures(20));
    assert_eq!(rooms, same_rooms, "the room that is drawn does not depend on the tries");
    assert!(once > often, "{once} of 40 failed with one try, {often} with twenty");
}
