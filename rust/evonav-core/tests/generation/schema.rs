//! The names in the core's records are those of Python's models.
//!
//! `tests/generation/test_result.py` compares the fields of the records with Python's models.

use evonav_core::generation::{
    Mode,
    record::{EvolutionOutcome, GoalRejection, ModificationFailure, RejectReason},
};
use serde_json::Value;

const DATASET: &str = include_str!("../../../../python/evonav/tasks/dataset.py");
const ORACLE: &str = include_str!("../../../../python/evonav/tasks/oracle.py");

/// Lists the names of an enum's variants; a variant that is missing here stops the build.
macro_rules! names {
    ($enum:ident: $($variant:ident),+) => {{
        let _ = |value: $enum| match value { $($enum::$variant => ()),+ };
        [$($enum::$variant),+].map(|value| serde_json::to_value(value).expect("an enum as JSON"))
    }};
}

/// Returns the names that a literal type of Python allows.
fn allowed(source: &str, literal: &str) -> Vec<Value> {
    let begin = format!("{literal}Literal[");
    let (_, rest) = source.split_once(&begin).unwrap_or_else(|| panic!("no {begin}"));
    let (names, _) = rest.split_once(']').expect("an end of the literal");
    names.split('"').skip(1).step_by(2).map(Value::from).collect()
}

#[test]
fn the_oracle_has_the_names_of_the_core() {
    let modes = names!(Mode: SalientObject, RetainGroup, FullShuffle);
    assert_eq!(allowed(ORACLE, "Mode = "), modes);
    let outcomes = names!(EvolutionOutcome: FirstStage, NotTriggered, NoRoom, NoPlacement, Evolved);
    assert_eq!(allowed(ORACLE, "Outcome = "), outcomes);
    let failures = names!(ModificationFailure: NothingMovable, NoFreePlace, CutsOff);
    assert_eq!(allowed(ORACLE, "Failure = "), failures);
    let rejections = names!(GoalRejection: NoReferencePose, NotVisible, Unreachable);
    assert_eq!(allowed(ORACLE, "reason: "), rejections);
}

#[test]
fn the_reasons_of_the_core_come_first_in_a_dataset() {
    let reasons = names!(
        RejectReason: TooFewRooms, NoStart, StartNotFree, StartOutside, Disconnected, NoValidGoal
    );
    let all = allowed(DATASET, "RejectReason = ");
    assert_eq!(all[..reasons.len()], reasons);
}
