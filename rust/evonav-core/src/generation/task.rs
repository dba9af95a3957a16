//! Algorithm 1 of the paper (Sec. A.1): generate a task from a house, stage by stage.

use std::cell::RefCell;

use serde::Serialize;

use crate::{
    Error,
    assets::{Catalogue, UnknownAssets},
    generation::{
        Extensions, Overrides, Parameters,
        algorithm::{
            during_stage::change_during_stage, scene_evolution::sample_scene_evolution,
            stage_task::sample_stage_task,
        },
        extensions::{schedule::Household, transition::Transition},
        record::{
            EvolutionOutcome, EvolutionRecord, GeneratedStage, GeneratedTask, RejectReason,
            Rejected,
        },
        stage::{
            generation_state::State, generator::Generator, relations::relations_of,
            stage_world::StageWorld,
        },
    },
    geometry::{Vec2, distance_2d_m},
    house::{House, HouseDelta},
};

/// The result of generation for one house.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Generation {
    /// The generated task.
    Task(GeneratedTask),
    /// The reason why no task was generated.
    Rejected(Rejected),
}

impl Generation {
    /// Write `{"task": ...}` without houses and images, or `{"rejected": ...}`.
    pub fn to_json(&self) -> String {
        // Only maps whose keys are not strings could fail, and there are none.
        serde_json::to_string(self).unwrap_or_default()
    }
}

/// Generate a task from a house.
///
/// # Arguments
/// * `seed`, `label` - names of the random streams; `label` should differ between houses, so that
///   one seed does not give the same draws in all of them.
/// * `parameters` - Θ.
/// * `overrides` - values that replace draws. Everything else is drawn from the same streams, so
///   that tasks that differ only in `overrides` or in `evolve_probability` share as much as
///   possible.
///
/// # Returns
/// The same result for the same arguments, on any number of threads. A given goal that is not in
/// the house, or has no reference pose there, gives [`RejectReason::NoValidGoal`].
///
/// # Errors
/// [`Error::InvalidArgument`] for bad parameters or more stages than a task may have;
/// [`Error::House`] for unknown assets, unless `unknown` allows them; [`Error::Simulation`] for
/// houses whose geometry makes no scene.
pub fn generate_task(
    house: &House,
    catalogue: &Catalogue,
    unknown: UnknownAssets,
    seed: u64,
    label: &str,
    parameters: &Parameters,
    overrides: &Overrides,
) -> Result<Generation, Error> {
    parameters.check()?;
    overrides.check()?;
    let num_rooms = house.rooms.len();
    if num_rooms < 2 {
        let detail = format!("{num_rooms} room(s)");
        return Ok(reject(RejectReason::TooFewRooms, 0, detail));
    }
    let frame = RefCell::default();
    let generator =
        Generator { catalogue, seed, label, parameters, overrides, frame, during: None };
    let choices = &parameters.num_stages;
    let drawn = generator.stream(0, "num_stages").below(choices.len());
    let num_stages = match overrides.stages.len() {
        0 => choices.get(drawn).copied().unwrap_or(1),
        num_given => num_given,
    };
    let mut world = StageWorld::build(house.clone(), catalogue, unknown)?;
    let mut state = match State::at_start(&world) {
        Ok(state) => state,
        Err(rejected) => return Ok(Generation::Rejected(rejected)),
    };
    let mut task = GeneratedTask { stages: vec![], houses: vec![], images: vec![] };
    let schedule_stream = |name: &str| generator.stream(0, &format!("schedule {name}"));
    let schedule = parameters.extensions.schedule;
    let mut household = schedule.map(|people| Household::new(people, house, schedule_stream));
    for stage in 1..=num_stages {
        let transition = Transition { generator: &generator, unknown, state: &state, stage };
        let (mut evolution, delta) = match &mut household {
            _ if stage == 1 => {
                (EvolutionRecord::unchanged(EvolutionOutcome::FirstStage), HouseDelta::default())
            }
            Some(household) => transition.follow_schedule(&world, household)?,
            None => sample_scene_evolution(&generator, &world, &state, stage)?,
        };
        let is_changed = !delta.is_empty() || parameters.extensions != Extensions::default();
        if !delta.is_empty() {
            world = StageWorld::build(world.house.apply(&delta)?, catalogue, unknown)?;
        }
        evolution.clock_min = household.as_ref().map(|people| people.time_of_day_min(stage));
        if stage > 1 {
            world = transition.extend(world, &mut evolution)?;
        }
        state.note_evolution(&evolution, &world.house);
        let made = match sample_stage_task(&generator, &world, &state, &evolution, stage)? {
            Ok(made) => made,
            Err(rejected) => return Ok(Generation::Rejected(rejected)),
        };
        let (target, mut reference, rejections) = made;
        task.images.push(std::mem::take(&mut reference.image));
        task.houses.push(match task.houses.last().filter(|_| !is_changed) {
            Some(house) => house.clone(),
            None => world.house.to_json(),
        });
        task.stages.push(GeneratedStage {
            relations: relations_of(&world.house, &world.layout, target.index),
            target: target.record,
            evolution,
            state: state.record(&world.house),
            start_pose: state.pose,
            rejections,
            reference_pose: reference.pose,
            reference_visible_px: reference.visible_px,
            appearance: reference.appearance.clone(),
            reference_path_length_m: length_m(&reference.path_m),
            reference_path_m: reference.path_m.clone(),
            ever_relocated_ids: state.relocated.iter().cloned().collect(),
            during: None,
        });
        state.note_stage(&world, &reference, target.room);
        let changed =
            change_during_stage(&generator, unknown, &world, &state, stage, target.index)?;
        if let (Some((record, next)), Some(stage)) = (changed, task.stages.last_mut()) {
            state.note_evolution(&record.evolution, &next.house);
            stage.during = Some(record);
            world = next;
        }
    }
    Ok(Generation::Task(task))
}

fn reject(reason: RejectReason, stage: usize, detail: String) -> Generation {
    Generation::Rejected(Rejected { reason, stage, detail })
}

fn length_m(path_m: &[Vec2]) -> f64 {
    path_m.windows(2).map(|pair| distance_2d_m(pair[0], pair[1])).sum()
}
