//! Generated tasks against what the paper asks of them, checked on the houses themselves: points
//! inside solids instead of outlines, boxes instead of scenes.

use std::collections::{BTreeMap, BTreeSet};

use super::tasks::{UNKNOWN, always, delta_of, generate, houses, navigation_in, stage_houses};
use crate::common::points::{contains, interpenetrate, object, parts_of, points_in};
use evonav_core::{
    assets::{Catalogue, part::Part, placement_rule::Place},
    generation::{
        AssetGroup, Mode, Parameters, asset_groups,
        record::{EvolutionOutcome, GeneratedStage, GeneratedTask},
    },
    geometry::{Vec2, Vec3, polygon_contains, sub},
    house::House,
    sensors::{
        camera::{Camera, View},
        raster::{FrameBuffer, Light, Style, Want, render_lit},
    },
    world::{mesh::SceneMesh, scene::Scene},
};

fn relocated(stage: &GeneratedStage) -> BTreeSet<&str> {
    let changes = stage.evolution.changes.iter().filter(|change| change.is_relocated);
    changes.map(|change| change.id.as_str()).collect()
}

#[test]
fn moved_objects_stand_in_their_room_in_nothing_and_on_something() {
    let mut num_moved = 0;
    for (house, mode) in houses().iter().flat_map(|h| Mode::ALL.map(|m| (h.clone(), m))) {
        for seed in 0..3 {
            let task = generate(&house, seed, &always(mode, 4));
            let stages = stage_houses(&task);
            for (k, stage) in task.stages.iter().enumerate().skip(1) {
                let (before, after) = (&stages[k - 1], &stages[k]);
                num_moved += relocated(stage).len();
                check_places(before, after, stage, mode);
            }
        }
    }
    assert!(num_moved > 200, "{num_moved}");
}

fn check_places(before: &House, after: &House, stage: &GeneratedStage, mode: Mode) {
    let moved: BTreeSet<&str> = stage.evolution.changes.iter().map(|c| c.id.as_str()).collect();
    let solids: BTreeMap<&str, Vec<Part>> =
        after.objects.iter().map(|o| (o.id.as_str(), parts_of(after, &o.id))).collect();
    for id in &moved {
        let (old, new) = (object(before, id), object(after, id));
        assert_eq!(old.room, new.room, "{id} left its room");
        let room = &after.rooms[new.room.unwrap()];
        assert_eq!(Some(&room.id), stage.evolution.room_id.as_ref(), "{id}");
        if new.parent.is_none() {
            assert!((new.position_m[1] - old.position_m[1]).abs() < 1e-12, "{id} rose");
            let corners = solids[id].iter().flat_map(|part| points_in(part, 1.0));
            assert!(
                corners.into_iter().all(|p| polygon_contains(&room.polygon_m, [p[0], p[2]])),
                "{id} stands out of {}",
                room.id,
            );
        } else if mode == Mode::FullShuffle {
            check_support(before, after, id, &solids);
        }
        // What shared points before may go on doing so: it moved rigidly.
        for (other, parts) in solids.iter().filter(|(other, _)| *other != id) {
            let touched = interpenetrate(&parts_of(before, id), &parts_of(before, other));
            assert!(
                touched || !interpenetrate(&solids[id], parts),
                "{id} is in {other} after {mode:?}",
            );
        }
    }
}

/// An object that got a place of its own is borne: there is something right under its middle.
fn check_support(before: &House, after: &House, id: &str, solids: &BTreeMap<&str, Vec<Part>>) {
    let (old, new) = (object(before, id), object(after, id));
    let parent = &after.objects[new.parent.unwrap()];
    let was_on = old.parent.map(|p| before.objects[p].id.as_str());
    if was_on == Some(parent.id.as_str()) {
        return; // Carried along, perhaps.
    }
    let lowest = solids[id]
        .iter()
        .flat_map(|part| points_in(part, 1.0))
        .fold(f64::INFINITY, |low, p| low.min(p[1]));
    // Round bottoms touch in a point and their samples end above it.
    let is_borne = |x: f64, z: f64| {
        (0..40)
            .map(|i| lowest - 0.002 * f64::from(i))
            .any(|y| solids[parent.id.as_str()].iter().any(|part| contains(part, [x, y, z], 0.0)))
    };
    let [x, _, z] = new.position_m;
    assert!(is_borne(x, z), "{id} floats over {}", parent.id);
    for p in solids[id].iter().flat_map(|part| points_in(part, 1.0)) {
        let [x, z] = [x + 0.7 * (p[0] - x), z + 0.7 * (p[2] - z)];
        assert!(is_borne(x, z), "{id} overhangs {}", parent.id);
    }
}

#[test]
fn furniture_that_moved_stands_off_doors() {
    for (house, seed) in houses().iter().flat_map(|h| (0..8).map(|s| (h.clone(), s))) {
        let task = generate(&house, seed, &always(Mode::RetainGroup, 4));
        for (stage, house) in task.stages.iter().zip(stage_houses(&task)) {
            let furniture = stage.evolution.changes.iter().filter(|c| c.to_support_id.is_none());
            for change in furniture {
                let solids = parts_of(&house, &change.id);
                for p in solids.iter().flat_map(|part| points_in(part, 1.0)) {
                    assert!(!is_at_door(&house, [p[0], p[2]]), "{} at a door", change.id);
                }
            }
        }
    }
}

/// Whether a point lies less than 0.49 m in front of or behind a door.
fn is_at_door(house: &House, point: Vec2) -> bool {
    house.doors.iter().any(|door| {
        let wall = house.walls.iter().find(|wall| wall.id == door.wall0).unwrap();
        let [dx, dz] = [wall.to_m[0] - wall.from_m[0], wall.to_m[1] - wall.from_m[1]];
        let length = dx.hypot(dz);
        let [px, pz] = [point[0] - wall.from_m[0], point[1] - wall.from_m[1]];
        let (along, across) = ((px * dx + pz * dz) / length, (px * dz - pz * dx) / length);
        let hole = door.hole_min_m[0] + 0.01..door.hole_max_m[0] - 0.01;
        across.abs() < 0.49 && hole.contains(&along)
    })
}

#[test]
fn salient_moves_one_piece_of_furniture_with_what_stands_on_it() {
    for (house, seed) in houses().iter().flat_map(|h| [0, 1, 2].map(|s| (h.clone(), s))) {
        let task = generate(&house, seed, &always(Mode::SalientObject, 4));
        let stages = stage_houses(&task);
        for (k, stage) in task.stages.iter().enumerate().skip(1) {
            let Some(salient) = &stage.evolution.salient_id else {
                assert_ne!(stage.evolution.outcome, EvolutionOutcome::Evolved);
                continue;
            };
            let before = object(&stages[k - 1], salient);
            assert_eq!(before.parent, None);
            let mut expected = BTreeSet::from([salient.as_str()]);
            expected.extend(before.children.iter().map(|&c| stages[k - 1].objects[c].id.as_str()));
            let changed: BTreeSet<&str> =
                stage.evolution.changes.iter().map(|c| c.id.as_str()).collect();
            assert_eq!(changed, expected);
            check_rigid(&stages[k - 1], &stages[k], &expected);
        }
    }
}

#[test]
fn retained_groups_keep_their_shape() {
    for (house, seed) in houses().iter().flat_map(|h| [0, 1, 2].map(|s| (h.clone(), s))) {
        let task = generate(&house, seed, &always(Mode::RetainGroup, 4));
        let stages = stage_houses(&task);
        for (k, stage) in task.stages.iter().enumerate().skip(1) {
            let (before, after) = (&stages[k - 1], &stages[k]);
            let moved: BTreeSet<&str> =
                stage.evolution.changes.iter().map(|c| c.id.as_str()).collect();
            let groups = asset_groups(before, Catalogue::bundled(), UNKNOWN).unwrap();
            let after_groups = asset_groups(after, Catalogue::bundled(), UNKNOWN).unwrap();
            for AssetGroup { roots, definition } in groups {
                let id = |&root: &usize| before.objects[root].id.as_str();
                let ids: BTreeSet<&str> = roots.iter().map(id).collect();
                let family = |root: &usize| -> BTreeSet<&str> {
                    let children = &before.objects[*root].children;
                    children.iter().map(id).chain([id(root)]).collect()
                };
                let members: BTreeSet<&str> = roots.iter().flat_map(family).collect();
                // All of a group moves, or none.
                assert!(members.is_subset(&moved) || members.is_disjoint(&moved), "{members:?}");
                if stage.evolution.rearranged_ids.iter().any(|r| ids.contains(r.as_str())) {
                    roots.iter().for_each(|root| check_rigid(before, after, &family(root)));
                    let is_same = |other: &AssetGroup| {
                        other
                            .roots
                            .iter()
                            .map(|&i| after.objects[i].id.as_str())
                            .collect::<BTreeSet<_>>()
                            == ids
                    };
                    assert!(definition.is_some() && after_groups.iter().any(is_same), "{ids:?}");
                } else {
                    check_rigid(before, after, &members);
                }
            }
            let changes = &stage.evolution.changes;
            assert!(changes.iter().all(|c| c.from_support_id == c.to_support_id));
        }
    }
}

/// Distances between members, and of each to the floor, stay.
fn check_rigid(before: &House, after: &House, members: &BTreeSet<&str>) {
    let distance = |house: &House, a: &str, b: &str| {
        let offset = sub(object(house, a).position_m, object(house, b).position_m);
        offset.iter().map(|v| v * v).sum::<f64>().sqrt()
    };
    for a in members {
        for b in members {
            assert!((distance(before, a, b) - distance(after, a, b)).abs() < 1e-3, "{a} {b}");
        }
    }
}

#[test]
fn what_hangs_on_walls_stays() {
    for (house, mode) in houses().iter().flat_map(|h| Mode::ALL.map(|m| (h.clone(), m))) {
        for stage in &generate(&house, 5, &always(mode, 4)).stages {
            for change in &stage.evolution.changes {
                let rule = Catalogue::bundled().placement(&change.category);
                let is_hung = rule.is_some_and(|rule| rule.is_placed(Place::Wall));
                assert!(!is_hung || change.from_support_id.is_some(), "{change:?}");
            }
        }
    }
}

#[test]
fn goals_hang_on_walls_only_where_that_is_allowed() {
    for goals_on_walls in [false, true] {
        let parameters = Parameters { goals_on_walls, ..Parameters::default() };
        let mut num_hung = 0;
        for (house, seed) in houses().iter().flat_map(|h| (0..12).map(|s| (h.clone(), s))) {
            for stage in &generate(&house, seed, &parameters).stages {
                let rule = Catalogue::bundled().placement(&stage.target.category);
                let is_hung = rule.is_some_and(|rule| rule.is_placed(Place::Wall));
                num_hung += usize::from(is_hung && stage.target.support_id.is_none());
            }
        }
        assert_eq!(num_hung > 0, goals_on_walls, "{num_hung}");
    }
}

#[test]
fn rooms_that_could_be_reached_still_can() {
    for (house, mode) in houses().iter().flat_map(|h| Mode::ALL.map(|m| (h.clone(), m))) {
        let task = generate(&house, 1, &always(mode, 4));
        let stages = stage_houses(&task);
        for (k, stage) in task.stages.iter().enumerate().skip(1) {
            let start = stage.start_pose.position_m;
            let [before, after] = [&stages[k - 1], &stages[k]].map(|h| rooms_from(h, start));
            assert!(!before.is_empty());
            assert!(after.is_superset(&before), "{mode:?}: {before:?} became {after:?}");
        }
    }
}

fn rooms_from(house: &House, start: Vec3) -> BTreeSet<usize> {
    let reached = navigation_in(house).reachable_positions([start[0], start[2]], 0.25).unwrap();
    reached.iter().filter_map(|&p| house.room_of(p)).collect()
}

#[test]
fn references_show_the_target_from_its_room_at_the_reference_distance() {
    for house in houses() {
        for (seed, reference_style) in (0..4).zip([Style::Plain, Style::Default].repeat(2)) {
            let parameters = Parameters { reference_style, ..Parameters::default() };
            let task = generate(&house, seed, &parameters);
            let mut end: Option<Vec3> = None;
            for ((stage, house), image) in
                task.stages.iter().zip(stage_houses(&task)).zip(&task.images)
            {
                let target = object(&house, &stage.target.id);
                assert_eq!(target.position_m, stage.target.position_m);
                let pose = stage.reference_pose;
                let plan = |p: Vec3| -> Vec2 { [p[0], p[2]] };
                let [a, b] = [plan(pose.position_m), plan(target.position_m)];
                assert!((1.0..=1.5).contains(&(a[0] - b[0]).hypot(a[1] - b[1])));
                assert_eq!(house.room_of(a), target.room);
                if let Some(end) = end {
                    assert_eq!(stage.start_pose.position_m, end);
                }
                end = Some(pose.position_m);
                let path = &stage.reference_path_m;
                let length: f64 =
                    path.windows(2).map(|p| (p[0][0] - p[1][0]).hypot(p[0][1] - p[1][1])).sum();
                assert!((length - stage.reference_path_length_m).abs() < 1e-9);
                assert!(
                    length >= {
                        let s = plan(stage.start_pose.position_m);
                        (s[0] - a[0]).hypot(s[1] - a[1]) - 0.05
                    }
                );

                let scene = Scene::build(&house, Catalogue::bundled(), UNKNOWN).unwrap();
                let camera = Camera {
                    width_px: 300,
                    height_px: 300,
                    vertical_fov_rad: 90_f64.to_radians(),
                    position_m: [a[0], 1.575, a[1]],
                    yaw_rad: pose.yaw_deg.to_radians(),
                    horizon_rad: pose.horizon_deg.to_radians(),
                };
                let mut frame = FrameBuffer::default();
                let (mesh, style) = (SceneMesh::build(&scene), reference_style);
                let light = (style == Style::Default).then(|| Light::build(&house, &scene, &mesh));
                let want = Want { rgb: Some(style), instances: true };
                render_lit(&mesh, light.as_ref(), &View::from(camera), want, &mut frame).unwrap();
                let body = scene.bodies.iter().position(|b| b.id == stage.target.id).unwrap() + 1;
                let count = frame.instances.iter().filter(|&&id| id == body as i32).count();
                assert_eq!(count, stage.reference_visible_px);
                assert!(count >= 50);
                assert_eq!(&frame.rgb, image);
            }
        }
    }
}

#[test]
fn the_style_of_reference_images_changes_only_them() {
    let house = &houses()[0];
    let [flat, lit] = [Style::Plain, Style::Default].map(|reference_style| {
        generate(house, 0, &Parameters { reference_style, ..Parameters::default() })
    });
    assert!(flat.images.iter().zip(&lit.images).all(|(a, b)| a != b));
    assert_eq!(GeneratedTask { images: vec![], ..flat }, GeneratedTask { images: vec![], ..lit });
}

#[test]
fn houses_follow_from_deltas_and_the_same_seed_gives_the_same_task() {
    for house in houses() {
        let parameters = Parameters { evolve_probability: 1.0, ..Parameters::default() };
        let task = generate(&house, 9, &parameters);
        assert_eq!(task, generate(&house, 9, &parameters));
        assert_ne!(task, generate(&house, 10, &parameters));
        let mut expected = house.clone();
        for (stage, json) in task.stages.iter().zip(&task.houses) {
            expected = expected.apply(&delta_of(&stage.evolution)).unwrap();
            assert_eq!(&expected.to_json(), json);
        }
    }
}

#[test]
fn history_records_say_what_happened() {
    let house = &houses()[1];
    for seed in 0..6 {
        let task = generate(house, seed, &Parameters::default());
        let mut ever: BTreeSet<String> = BTreeSet::new();
        let mut changed = Vec::new();
        let mut goals: Vec<String> = Vec::new();
        for (k, stage) in task.stages.iter().enumerate() {
            let evolution = &stage.evolution;
            assert_eq!(evolution.outcome == EvolutionOutcome::FirstStage, k == 0);
            ever.extend(relocated(stage).into_iter().map(str::to_owned));
            assert_eq!(stage.ever_relocated_ids, ever.iter().cloned().collect::<Vec<_>>());
            assert_eq!(stage.target.is_relocated_ever, ever.contains(&stage.target.id));
            if k > 0 {
                let is_evolved = evolution.outcome == EvolutionOutcome::Evolved;
                changed.push(evolution.room_id.clone().filter(|_| is_evolved));
                assert_eq!(stage.state.transition_room_id.as_ref(), goals.last());
            }
            let last_two = |len: usize| len.saturating_sub(2);
            assert_eq!(stage.state.changed_room_ids, changed[last_two(changed.len())..]);
            assert_eq!(stage.state.goal_room_ids, goals[last_two(goals.len())..]);
            for weight in &evolution.room_weights {
                let visited = stage.state.visited_room_ids.contains(&weight.room_id);
                assert_eq!(weight.history.is_visited, visited);
                let is_transition = Some(&weight.room_id) == goals.last();
                assert_eq!(weight.history.is_transition_room, is_transition);
                assert!(!is_transition || weight.weight == 0.0);
            }
            goals.push(stage.target.room_id.clone());
        }
    }
}
