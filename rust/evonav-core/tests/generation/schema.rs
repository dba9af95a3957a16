//! The names in the core's records are those of the JSON Schemas that Python publishes.
//!
//! `tests/generation/test_result.py` compares the fields of the records with Python's models.

use evonav_core::generation::{
    Mode,
    record::{EvolutionOutcome, GoalRejection, ModificationFailure, RejectReason},
};
use serde_json::Value;

const DATASET: &str = include_str!("../../../../python/evonav/tasks/schema/dataset.schema.json");
const ORACLE: &str =
    include_str!("../../../../python/evonav/tasks/schema/oracle_stage.schema.json");

/// Lists the names of an enum's variants; a variant that is missing here stops the build.
macro_rules! names {
    ($enum:ident: $($variant:ident),+) => {{
        let _ = |value: $enum| match value { $($enum::$variant => ()),+ };
        [$($enum::$variant),+].map(|value| serde_json::to_value(value).expect("an enum as JSON"))
    }};
}

/// Returns the names that a schema allows at a path, without `null`.
fn allowed(schema: &str, path: &str) -> Vec<Value> {
    let schema: Value = serde_json::from_str(schema).expect("a schema");
    let field = schema.pointer(path).unwrap_or_else(|| panic!("no {path}"));
    let options = field.get("anyOf").and_then(Value::as_array);
    let values = options.map_or(field, |options| &options[0]).get("enum");
    values.and_then(Value::as_array).unwrap_or_else(|| panic!("no enum at {path}")).clone()
}

#[test]
fn the_oracle_has_the_names_of_the_core() {
    let modes = names!(Mode: SalientObject, RetainGroup, FullShuffle);
    assert_eq!(allowed(ORACLE, "/$defs/Evolution/properties/mode"), modes);
    let outcomes = names!(EvolutionOutcome: FirstStage, NotTriggered, NoRoom, NoPlacement, Evolved);
    assert_eq!(allowed(ORACLE, "/$defs/Evolution/properties/outcome"), outcomes);
    let failures = names!(ModificationFailure: NothingMovable, NoFreePlace, CutsOff);
    assert_eq!(allowed(ORACLE, "/$defs/Evolution/properties/failure"), failures);
    let rejections = names!(GoalRejection: NoReferencePose, NotVisible, Unreachable);
    assert_eq!(allowed(ORACLE, "/$defs/Rejection/properties/reason"), rejections);
}

#[test]
fn the_reasons_of_the_core_come_first_in_a_dataset() {
    let reasons = names!(
        RejectReason: TooFewRooms, NoStart, StartNotFree, StartOutside, Disconnected, NoValidGoal
    );
    let all = allowed(DATASET, "/$defs/HouseRejection/properties/reason");
    assert_eq!(all[..reasons.len()], reasons);
}
