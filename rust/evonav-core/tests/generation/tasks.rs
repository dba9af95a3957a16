//! The two small houses, and tasks that are made of a house.

use evonav_core::{
    Error,
    assets::{Catalogue, UnknownAssets},
    generation::{
        Generation, Mode, Overrides, Parameters, generate_task,
        record::{EvolutionRecord, GeneratedTask},
    },
    house::{AddedObject, House, HouseDelta, ObjectMove, StateChange},
    world::{
        navigation::{AgentBody, Navigation, NavigationConfig},
        scene::Scene,
    },
};

pub const UNKNOWN: UnknownAssets = UnknownAssets::CategoryDefault;

pub fn houses() -> Vec<House> {
    let texts = [
        include_str!("../data/house_39_objects.json"),
        include_str!("../data/house_100_objects.json"),
    ];
    texts.iter().map(|text| House::from_json("test house", text).unwrap()).collect()
}

/// Every transition evolves, by one mode.
pub fn always(mode: Mode, num_stages: usize) -> Parameters {
    let [salient, retain, shuffle] = Mode::ALL.map(|m| f64::from(u8::from(m == mode)));
    Parameters {
        evolve_probability: 1.0,
        salient_object_probability: salient,
        retain_group_probability: retain,
        full_shuffle_probability: shuffle,
        num_stages: vec![num_stages],
        ..Parameters::default()
    }
}

/// Makes a task with nothing given, or gives the reason why not.
pub fn try_generate(
    house: &House,
    seed: u64,
    parameters: &Parameters,
) -> Result<Generation, Error> {
    let (catalogue, nothing) = (Catalogue::bundled(), Overrides::default());
    generate_task(house, catalogue, UNKNOWN, seed, "test", parameters, &nothing)
}

pub fn task_in(generation: Generation) -> GeneratedTask {
    match generation {
        Generation::Task(task) => task,
        Generation::Rejected(rejected) => panic!("{rejected:?}"),
    }
}

/// A task that must be made.
pub fn generate(house: &House, seed: u64, parameters: &Parameters) -> GeneratedTask {
    task_in(try_generate(house, seed, parameters).unwrap())
}

pub fn stage_houses(task: &GeneratedTask) -> Vec<House> {
    task.houses.iter().map(|json| House::from_json("stage", json).unwrap()).collect()
}

pub fn navigation_in(house: &House) -> Navigation {
    let scene = Scene::build(house, Catalogue::bundled(), UNKNOWN).unwrap();
    Navigation::build(&scene, AgentBody::DEFAULT, NavigationConfig::default()).unwrap()
}

/// The delta that leads from the house of the previous stage to this one, as recorded.
pub fn delta_of(record: &EvolutionRecord) -> HouseDelta {
    let moves = record.changes.iter().map(|change| ObjectMove {
        id: change.id.clone(),
        position_m: change.to_position_m,
        rotation_deg: change.to_rotation_deg,
        parent: change.to_support_id.clone(),
    });
    let added = record.additions.iter().map(|object| AddedObject {
        id: object.id.clone(),
        asset_id: object.asset_id.clone(),
        position_m: object.position_m,
        rotation_deg: object.rotation_deg,
        parent: object.support_id.clone(),
    });
    let states = record.states.iter().map(|change| StateChange {
        id: change.id.clone(),
        openness: (change.field == "openness").then_some(change.after),
        is_on: (change.field == "isOn").then_some(change.after > 0.0),
    });
    HouseDelta {
        moves: moves.collect(),
        removed: record.removals.iter().map(|object| object.id.clone()).collect(),
        added: added.collect(),
        states: states.collect(),
    }
}
