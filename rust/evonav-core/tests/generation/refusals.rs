//! Houses that allow no task and parameters that make no sense are refused.

use super::tasks::{houses, try_generate};
use evonav_core::{
    generation::{Generation, Parameters, record::RejectReason},
    house::House,
};

#[test]
fn houses_that_allow_no_task_are_refused_with_a_reason() {
    let house = &houses()[0];
    let refused = |house: &House, parameters: &Parameters| match try_generate(house, 0, parameters)
        .unwrap()
    {
        Generation::Rejected(rejected) => rejected.reason,
        Generation::Task(_) => panic!("made a task"),
    };
    let mut one_room = house.clone();
    one_room.rooms.truncate(1);
    assert_eq!(refused(&one_room, &Parameters::default()), RejectReason::TooFewRooms);
    let mut no_start = house.clone();
    no_start.start = None;
    assert_eq!(refused(&no_start, &Parameters::default()), RejectReason::NoStart);
    let mut outside = house.clone();
    if let Some(start) = &mut outside.start {
        start.position_m = [-50.0, 0.9, -50.0];
    }
    assert_eq!(refused(&outside, &Parameters::default()), RejectReason::StartNotFree);
    let blind = Parameters { reference_min_visible_px: usize::MAX, ..Parameters::default() };
    assert_eq!(refused(house, &blind), RejectReason::NoValidGoal);
}

#[test]
fn bad_parameters_are_named() {
    let bad = [
        Parameters { evolve_probability: 1.5, ..Parameters::default() },
        Parameters { num_stages: vec![], ..Parameters::default() },
        Parameters { num_stages: vec![0], ..Parameters::default() },
        Parameters { visited_factor: f64::NAN, ..Parameters::default() },
        Parameters { reference_max_m: 0.5, ..Parameters::default() },
        Parameters { placement_tries: 0, ..Parameters::default() },
        Parameters {
            salient_object_probability: 0.0,
            retain_group_probability: 0.0,
            full_shuffle_probability: 0.0,
            ..Parameters::default()
        },
    ];
    for parameters in bad {
        let made = try_generate(&houses()[0], 0, &parameters);
        assert!(matches!(made, Err(evonav_core::Error::InvalidArgument { .. })), "{parameters:?}");
    }
    assert!(Parameters::from_json("{}").is_err());
    let written = serde_json::to_string(&Parameters::default()).unwrap();
    assert_eq!(Parameters::from_json(&written), Ok(Parameters::default()));
}
