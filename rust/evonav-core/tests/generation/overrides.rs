//! Overrides draws against drawn ones: what is given as it was drawn changes nothing, what is given
//! otherwise changes that alone.

use evonav_core::{
    assets::Catalogue,
    generation::{
        Generation, Overrides, Parameters, StageOverrides, generate_task,
        record::{EvolutionOutcome, GeneratedTask, RejectReason},
    },
    house::House,
};
use proptest::prelude::*;

use super::tasks::{UNKNOWN, generate, houses, task_in};

fn small(evolve_probability: f64) -> Parameters {
    Parameters { evolve_probability, reference_image_px: 64, ..Parameters::default() }
}

fn made(house: &House, seed: u64, parameters: &Parameters, given: &Overrides) -> Generation {
    generate_task(house, Catalogue::bundled(), UNKNOWN, seed, "test", parameters, given).unwrap()
}

/// The task less the goals that were drawn and refused: a given one is not drawn.
fn without_refusals(task: &GeneratedTask) -> GeneratedTask {
    let mut task = task.clone();
    task.stages.iter_mut().for_each(|stage| stage.rejections.clear());
    task
}

fn goals_of(task: &GeneratedTask) -> Vec<StageOverrides> {
    let goals = task.stages.iter().map(|stage| stage.target.id.clone());
    goals.map(|id| StageOverrides { goal_id: Some(id), is_evolved: None }).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn what_is_given_as_it_was_drawn_changes_nothing(which in 0..2_usize, seed in 0..1000_u64) {
        let house = &houses()[which];
        let parameters = small(0.5);
        let free = generate(house, seed, &parameters);
        let mut stages = goals_of(&free);
        for (given, stage) in stages.iter_mut().zip(&free.stages).skip(1) {
            given.is_evolved = Some(stage.evolution.outcome != EvolutionOutcome::NotTriggered);
        }
        // The probability no longer matters either: every trigger is given.
        let again = task_in(made(house, seed, &small(0.0), &Overrides { stages }));
        prop_assert_eq!(without_refusals(&free), without_refusals(&again));
    }

    #[test]
    fn a_larger_probability_evolves_wherever_a_smaller_one_does(
        which in 0..2_usize, seed in 0..1000_u64, low in 0.0..1.0_f64, high in 0.0..1.0_f64,
    ) {
        let house = &houses()[which];
        let stages = goals_of(&generate(house, seed, &small(0.0)));
        let triggers = |p: f64| -> Option<Vec<bool>> {
            let given = Overrides { stages: stages.clone() };
            let Generation::Task(task) = made(house, seed, &small(p), &given) else { return None };
            for (given, stage) in stages.iter().zip(&task.stages) {
                assert_eq!(given.goal_id.as_ref(), Some(&stage.target.id));
            }
            let is_triggered = |stage: &evonav_core::generation::record::GeneratedStage| {
                !matches!(
                    stage.evolution.outcome,
                    EvolutionOutcome::NotTriggered | EvolutionOutcome::FirstStage
                )
            };
            Some(task.stages.iter().map(is_triggered).collect())
        };
        if let (Some(few), Some(many)) = (triggers(low.min(high)), triggers(low.max(high))) {
            prop_assert!(few.iter().zip(&many).all(|(few, many)| few <= many));
        }
    }
}

#[test]
fn a_change_is_made_where_it_is_given_and_nowhere_else() {
    let mut num_evolved = 0;
    for (house, seed) in houses().iter().flat_map(|house| (0..4).map(move |seed| (house, seed))) {
        let fixed = generate(house, seed, &small(0.0));
        let mut stages = goals_of(&fixed);
        stages.truncate(3);
        let first_goal = stages[0].goal_id.clone();
        stages[2].goal_id = first_goal;
        stages[2].is_evolved = Some(true);
        let Generation::Task(evolved) = made(house, seed, &small(0.0), &Overrides { stages })
        else {
            continue;
        };
        assert_eq!(evolved.stages.len(), 3);
        let [evolved_stages, fixed_stages] =
            [&evolved, &fixed].map(|task| without_refusals(task).stages[..2].to_vec());
        assert_eq!(evolved_stages, fixed_stages);
        assert_eq!(evolved.images[..2], fixed.images[..2]);
        assert_eq!(evolved.houses[..2], fixed.houses[..2]);
        assert_eq!(evolved.stages[2].target.id, evolved.stages[0].target.id);
        let outcome = evolved.stages[2].evolution.outcome;
        assert!(outcome != EvolutionOutcome::NotTriggered);
        if outcome == EvolutionOutcome::Evolved {
            num_evolved += 1;
            assert_ne!(evolved.houses[2], evolved.houses[1]);
        }
    }
    assert!(num_evolved >= 3, "{num_evolved}");
}

#[test]
fn a_goal_that_is_not_there_is_refused() {
    let goal_id = Some("no such object".to_owned());
    let given = Overrides { stages: vec![StageOverrides { goal_id, is_evolved: None }] };
    match made(&houses()[0], 0, &small(0.5), &given) {
        Generation::Rejected(rejected) => {
            assert_eq!((rejected.reason, rejected.stage), (RejectReason::NoValidGoal, 1));
            assert!(rejected.detail.contains("no such object"), "{}", rejected.detail);
        }
        Generation::Task(_) => panic!("a task"),
    }
}

#[test]
fn what_cannot_be_given_is_told() {
    assert_eq!(Overrides::from_json("{}").unwrap(), Overrides::default());
    for json in ["", "[1]", r#"{"stages": [{"goal": "a"}]}"#, r#"{"stages": [{"goal_id": 3}]}"#] {
        assert!(Overrides::from_json(json).unwrap_err().to_string().contains("given"), "{json}");
    }
    let many = format!(r#"{{"stages": [{}]}}"#, vec!["{}"; 65].join(","));
    assert!(Overrides::from_json(&many).unwrap_err().to_string().contains("64"));
}
