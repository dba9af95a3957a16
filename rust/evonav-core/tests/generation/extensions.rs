//! What goes beyond the paper, checked on the houses themselves: points inside solids instead of
//! outlines, documents instead of layouts.

use std::collections::{BTreeMap, BTreeSet};

use evonav_core::{
    assets::{Catalogue, part::Part},
    generation::{
        Extensions, Occurrence, Parameters, Schedule,
        record::{EvolutionOutcome, GeneratedTask},
    },
    geometry::Vec2,
    house::House,
    world::{
        navigation::{AgentBody, Navigation, NavigationConfig},
        scene::{BodyKind, Scene},
    },
};
use serde_json::Value;

use super::tasks::{self, UNKNOWN, delta_of, houses, stage_houses};
use crate::common::points::{contains, points_in};
use crate::common::solids::holds;

const OFTEN: Option<Occurrence> = Some(Occurrence { probability: 1.0, max_count: 6 });

fn generate(house: &House, seed: u64, extensions: Extensions) -> GeneratedTask {
    let parameters = Parameters { num_stages: vec![5], extensions, ..Parameters::default() };
    tasks::generate(house, seed, &parameters)
}

fn all_on() -> Extensions {
    Extensions {
        insertion: OFTEN,
        removal: OFTEN,
        doors: OFTEN,
        openables: OFTEN,
        switches: OFTEN,
        schedule: None,
        during_stage: None,
    }
}

fn people() -> Extensions {
    let schedule = Schedule { num_persons: 3, minutes_between_stages: 180, tidiness: 0.7 };
    Extensions { schedule: Some(schedule), ..Extensions::default() }
}

/// Every object of a document by id, without what stands on it, and with what it stands on.
fn entries(house: &House) -> BTreeMap<String, Value> {
    fn walk(list: &Value, parent: &str, found: &mut BTreeMap<String, Value>) {
        for object in list.as_array().into_iter().flatten() {
            let id = object["id"].as_str().unwrap().to_owned();
            let mut own = object.clone();
            own.as_object_mut().unwrap().remove("children");
            own["parent"] = Value::from(parent);
            walk(&object["children"], &id, found);
            found.insert(id, own);
        }
    }
    let document: Value = serde_json::from_str(&house.to_json()).unwrap();
    let mut found = BTreeMap::new();
    walk(&document["objects"], "", &mut found);
    for door in document["doors"].as_array().into_iter().flatten() {
        found.insert(door["id"].as_str().unwrap().to_owned(), door.clone());
    }
    found
}

/// Whether parts share space with any object but `id`, or, if asked, with walls.
fn collides(scene: &Scene, id: &str, parts: &[Part], with_walls: bool) -> Option<String> {
    let others = scene.bodies.iter().filter(|body| {
        body.id != id
            && match body.kind {
                BodyKind::Object => true,
                BodyKind::Wall | BodyKind::Window | BodyKind::Door => with_walls,
                BodyKind::Floor | BodyKind::Ceiling => false,
            }
    });
    for other in others {
        for part in parts.iter().filter(|part| part.aabb().intersects(&other.aabb)) {
            let points = points_in(part, 0.9);
            if other.parts.iter().any(|its| points.iter().any(|&point| contains(its, point, 0.004)))
            {
                return Some(other.id.clone());
            }
        }
    }
    None
}

fn reachable_rooms(house: &House, scene: &Scene, from_m: Vec2) -> BTreeSet<String> {
    let navigation =
        Navigation::build(scene, AgentBody::DEFAULT, NavigationConfig::default()).unwrap();
    let positions = navigation.reachable_positions(from_m, 0.25).unwrap();
    positions.iter().filter_map(|&p| house.room_id_of(p).map(str::to_owned)).collect()
}

/// Checks every transition of a task, and returns how many additions, removals, states and moves
/// there are.
fn check(task: &GeneratedTask) -> [usize; 4] {
    let houses = stage_houses(task);
    let scenes: Vec<Scene> = houses
        .iter()
        .map(|house| Scene::build(house, Catalogue::bundled(), UNKNOWN).unwrap())
        .collect();
    let mut counts = [0; 4];
    for (k, stage) in task.stages.iter().enumerate().skip(1) {
        let (evolution, before, after) = (&stage.evolution, &houses[k - 1], &houses[k]);
        // The record says it all.
        let again: Value =
            serde_json::from_str(&before.apply(&delta_of(evolution)).unwrap().to_json()).unwrap();
        let made: Value = serde_json::from_str(&task.houses[k]).unwrap();
        assert!(again == made, "stage {} does not follow from its record", k + 1);
        let (then, now) = (entries(before), entries(after));
        let touched: BTreeSet<&String> = evolution
            .changes
            .iter()
            .map(|change| &change.id)
            .chain(evolution.additions.iter().map(|object| &object.id))
            .chain(evolution.removals.iter().map(|object| &object.id))
            .chain(evolution.states.iter().map(|change| &change.id))
            .collect();
        for id in then.keys().chain(now.keys()) {
            assert_eq!(then.get(id) != now.get(id), touched.contains(id), "{id}");
        }
        // What the reference trajectory sees stays as it is.
        let [x, _, z] = stage.start_pose.position_m;
        let stands_in = before.room_of([x, z]);
        for house in [before, after] {
            for object in house.objects.iter().filter(|object| object.room == stands_in) {
                assert!(!touched.contains(&object.id), "{} in the transition room", object.id);
            }
        }
        let (was, is) = (
            reachable_rooms(before, &scenes[k - 1], [x, z]),
            reachable_rooms(after, &scenes[k], [x, z]),
        );
        assert!(was.is_subset(&is), "{was:?} {is:?}");
        for object in &evolution.removals {
            assert!(!now.contains_key(&object.id) && then.contains_key(&object.id));
        }
        assert!(now.contains_key(&stage.target.id));
        for object in &evolution.additions {
            assert!(!then.contains_key(&object.id) && object.cause == "INSERTION");
            assert!(Catalogue::bundled().get(&object.asset_id).unwrap().is_pickupable);
            assert_stands(&scenes[k], &object.id, object.support_id.as_deref());
        }
        for change in evolution.changes.iter().filter(|c| c.cause.starts_with("ACTIVITY:")) {
            // What is put back stands as the file had it, which may be in the air.
            let first = &houses[0].objects[houses[0].object_index(&change.id).unwrap()];
            if change.to_position_m != first.position_m {
                assert_stands(&scenes[k], &change.id, change.to_support_id.as_deref());
            }
        }
        for change in evolution.states.iter().filter(|change| change.field == "openness") {
            assert!((0.0..=1.0).contains(&change.after) && change.before != change.after);
            let [old, new] = [k - 1, k]
                .map(|k| scenes[k].bodies.iter().find(|body| body.id == change.id).unwrap());
            let is_moved = |part: &&Part| !old.parts.contains(part);
            let moved: Vec<Part> = new.parts.iter().filter(is_moved).copied().collect();
            assert!(!moved.is_empty(), "{} shows that it is {}", change.id, change.after);
            let is_object = new.kind == BodyKind::Object;
            assert_eq!(collides(&scenes[k], &change.id, &moved, is_object), None, "{}", change.id);
        }
        counts[0] += evolution.additions.len();
        counts[1] += evolution.removals.len();
        counts[2] += evolution.states.len();
        counts[3] += evolution.changes.len();
    }
    counts
}

/// Something is free, and on what it is said to stand on.
fn assert_stands(scene: &Scene, id: &str, support: Option<&str>) {
    let body = |id: &str| scene.bodies.iter().find(|body| body.id == id).unwrap();
    let (own, support) = (body(id), body(support.unwrap()));
    assert_eq!(collides(scene, id, &own.parts, true), None, "{id}");
    let [x, _, z] = own.aabb.centre_m();
    let below = (1..6).map(|step| [x, own.aabb.min_m[1] - 0.004 * f64::from(step), z]);
    let mut below = below.into_iter();
    let is_borne = below.any(|point| support.parts.iter().any(|part| holds(part, point)));
    assert!(is_borne, "{id} on {}", support.id);
}

#[test]
fn extensions_that_never_happen_change_nothing() {
    let never = Some(Occurrence { probability: 0.0, max_count: 64 });
    let extensions = Extensions {
        insertion: never,
        removal: never,
        doors: never,
        openables: never,
        switches: never,
        schedule: None,
        during_stage: None,
    };
    for house in houses() {
        for seed in 0..4 {
            let plain = generate(&house, seed, Extensions::default());
            assert!(plain == generate(&house, seed, extensions.clone()));
            for stage in &plain.stages {
                let evolution = &stage.evolution;
                assert!(evolution.additions.is_empty() && evolution.removals.is_empty());
                assert!(evolution.states.is_empty() && evolution.activities.is_empty());
                let mode = evolution.mode.map(|mode| mode.name());
                assert!(evolution.changes.iter().all(|c| Some(c.cause.as_str()) == mode));
            }
        }
    }
}

#[test]
fn things_come_go_open_and_light_up_validly() {
    let mut counts = [0; 4];
    for house in houses() {
        for seed in 0..3 {
            let task = generate(&house, seed, all_on());
            assert!(task == generate(&house, seed, all_on()));
            for (total, found) in counts.iter_mut().zip(check(&task)) {
                *total += found;
            }
        }
    }
    // 24 transitions, 3.5 things each on the average, where there is room for them.
    assert!(counts[0] > 30 && counts[1] > 30 && counts[2] > 30, "{counts:?}");
}

#[test]
fn one_extension_leaves_the_draws_of_the_others_alone() {
    let house = &houses()[1];
    let removal = Extensions { removal: OFTEN, ..Extensions::default() };
    let both = Extensions { insertion: OFTEN, ..removal.clone() };
    for seed in 0..3 {
        let (alone, with) =
            (generate(house, seed, removal.clone()), generate(house, seed, both.clone()));
        let first = |task: &GeneratedTask| task.stages[1].evolution.removals.clone();
        assert_eq!(first(&alone), first(&with));
        let paper = generate(house, seed, Extensions::default());
        assert_eq!(paper.stages[1].evolution.changes, alone.stages[1].evolution.changes);
    }
}

#[test]
fn people_carry_things_where_they_use_them() {
    let table: Value = serde_json::from_str(include_str!("../../data/activities.json")).unwrap();
    let known = |name: &str| {
        table["activities"].as_array().unwrap().iter().find(|one| one["name"] == name).cloned()
    };
    let (mut num_moved, mut num_across) = (0, 0);
    for house in houses() {
        for seed in 0..3 {
            let task = generate(&house, seed, people());
            assert!(task == generate(&house, seed, people()));
            num_moved += check(&task)[3];
            let clock = task.stages[0].evolution.clock_min.unwrap();
            let houses = stage_houses(&task);
            for (k, stage) in task.stages.iter().enumerate() {
                let evolution = &stage.evolution;
                assert_eq!(evolution.clock_min, Some((clock + 180 * k) % 1440));
                assert!(evolution.mode.is_none() && evolution.room_weights.is_empty());
                let is_evolved = evolution.outcome == EvolutionOutcome::Evolved;
                assert_eq!(is_evolved, !evolution.changes.is_empty());
                for doing in &evolution.activities {
                    let one = known(&doing.name).unwrap();
                    let end_min = clock + 180 * k;
                    assert!(doing.start_min <= end_min && doing.start_min + 180 > end_min - 180);
                    let room =
                        houses[k].rooms.iter().find(|r| Some(&r.id) == doing.room_id.as_ref());
                    let room_type = Value::from(room.unwrap().room_type.as_str());
                    assert!(one["rooms"].as_array().unwrap().contains(&room_type));
                }
                for change in &evolution.changes {
                    let name = change.cause.strip_prefix("ACTIVITY:").unwrap();
                    assert!(known(name).is_some(), "{name}");
                    let room =
                        |house: &House| house.objects[house.object_index(&change.id).unwrap()].room;
                    num_across += usize::from(room(&houses[k - 1]) != room(&houses[k]));
                }
            }
        }
    }
    assert!(num_moved > 20 && num_across > 5, "{num_moved} moved, {num_across} across rooms");
}

#[test]
fn the_tidy_bring_things_back() {
    let schedule = |tidiness| Schedule { num_persons: 4, minutes_between_stages: 1440, tidiness };
    let left_over = |tidiness: f64| -> usize {
        let extensions = Extensions { schedule: Some(schedule(tidiness)), ..Extensions::default() };
        (0..3)
            .map(|seed| {
                let task = generate(&houses()[1], seed, extensions.clone());
                let houses = stage_houses(&task);
                let (first, last) = (entries(&houses[0]), entries(houses.last().unwrap()));
                first.iter().filter(|(id, entry)| last.get(*id) != Some(entry)).count()
            })
            .sum()
    };
    let (messy, tidy) = (left_over(0.0), left_over(1.0));
    assert!(2 * tidy < messy, "{tidy} things lie about in tidy houses, {messy} in others");
}

#[test]
fn bad_values_are_named() {
    let cases = [
        (
            r#"{"insertion": {"probability": 1.5, "max_count": 1}}"#,
            "extensions.insertion.probability",
        ),
        (r#"{"removal": {"probability": 0.5, "max_count": 0}}"#, "extensions.removal.max_count"),
        (r#"{"doors": {"probability": -1.0, "max_count": 1}}"#, "extensions.doors.probability"),
        (
            r#"{"openables": {"probability": 1.0, "max_count": 65}}"#,
            "extensions.openables.max_count",
        ),
        (
            r#"{"schedule": {"num_persons": 0, "minutes_between_stages": 60, "tidiness": 1.0}}"#,
            "extensions.schedule.num_persons",
        ),
        (
            r#"{"schedule": {"num_persons": 1, "minutes_between_stages": 0, "tidiness": 1.0}}"#,
            "extensions.schedule.minutes_between_stages",
        ),
        (
            r#"{"schedule": {"num_persons": 1, "minutes_between_stages": 60, "tidiness": 2.0}}"#,
            "extensions.schedule.tidiness",
        ),
        (r#"{"insertion": {"probability": 1.0}}"#, "max_count"),
        (r#"{"insertions": null}"#, "insertions"),
    ];
    let theta: Value = serde_json::to_value(Parameters::default()).unwrap();
    for (extensions, name) in cases {
        let mut theta = theta.clone();
        theta["extensions"] = serde_json::from_str(extensions).unwrap();
        let error = Parameters::from_json(&theta.to_string()).unwrap_err().to_string();
        assert!(error.contains(name), "{error}");
    }
    assert!(all_on() != Extensions::default());
}
