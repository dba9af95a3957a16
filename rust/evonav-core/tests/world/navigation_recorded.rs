//! Navigation in real ProcTHOR houses, against positions recorded from AI2-THOR itself.

use std::collections::BTreeMap;

use crate::common::recorded::{bundled_lines, data_set, house_of, lines, navigation_of, scene_of};
use evonav_core::{geometry::Vec2, world::navigation::AgentBody};
use serde_json::Value;

/// AI2-THOR's LoCoBot and Stretch (agent modes "locobot" and "stretch").
const LOCOBOT: AgentBody = AgentBody { radius_m: 0.175, height_m: 0.9 };
const STRETCH: AgentBody = AgentBody { radius_m: 0.185_462_8, height_m: 1.435_714 };

/// `[x, z]` of a JSON position, an object or an array.
fn xz(position: &Value) -> Vec2 {
    let at = |key: &str, index: usize| {
        let value = if position.is_array() { &position[index] } else { &position[key] };
        value.as_f64().expect("a number")
    };
    [at("x", 0), at("z", 2)]
}

/// Share of `positions` that are free; prints what stands at the others.
fn share_free(name: &str, line: &str, agent: AgentBody, positions: &[Vec2]) -> [usize; 2] {
    let house = house_of(name, line);
    let scene = scene_of(&house);
    let navigation = navigation_of(&scene, agent);
    let mut num_free = 0;
    for &position in positions {
        if navigation.is_free(position) {
            num_free += 1;
            continue;
        }
        let blocker = navigation.obstacles().blocker_between(position, position);
        let what = blocker.map_or("off the floor".to_owned(), |i| {
            let asset = house.object_index(&scene.bodies[i].id);
            let asset = asset.map_or("", |i| house.objects[i].asset_id.as_str());
            format!("{} {asset}", scene.bodies[i].id)
        });
        let wider = (1..40).map(|i| f64::from(i) * 0.005).find(|shrink| {
            let agent = AgentBody { radius_m: agent.radius_m - shrink, ..agent };
            agent.radius_m > 0.0 && navigation_of(&scene, agent).is_free(position)
        });
        eprintln!("blocked: {name} {position:?} by {what}, too close by {wider:?}");
    }
    [num_free, positions.len()]
}

fn assert_share(name: &str, [num_good, num_all]: [usize; 2], least: f64) {
    let share = num_good as f64 / num_all as f64;
    eprintln!("{name}: {num_good} of {num_all} ({share:.4})");
    assert!(num_all > 0 && share >= least, "{name}: {num_good} of {num_all}");
}

/// Positions by line number of their house.
fn by_house(records: impl IntoIterator<Item = (usize, Vec2)>) -> BTreeMap<usize, Vec<Vec2>> {
    let mut positions: BTreeMap<usize, Vec<Vec2>> = BTreeMap::new();
    for (house, position) in records {
        let known = positions.entry(house).or_default();
        if !known.contains(&position) {
            known.push(position);
        }
    }
    positions
}

fn total(counts: impl Iterator<Item = [usize; 2]>) -> [usize; 2] {
    counts.fold([0; 2], |sum, count| [sum[0] + count[0], sum[1] + count[1]])
}

#[test]
fn locobot_start_positions_are_free() {
    let Some(folder) = data_set("ram81-procthor-1k") else { return };
    let houses = lines(&folder.join("val.jsonl.gz"));
    let episodes = lines(&folder.join("procthor-attr-onav-locobot-val.jsonl.gz"));
    let positions = by_house(episodes.iter().map(|line| {
        let episode: Value = serde_json::from_str(line).expect("JSON");
        let house = episode["scene"].as_u64().expect("a line number") as usize;
        (house, xz(&episode["agentPose"]["position"]))
    }));
    let shares = positions.iter().map(|(&house, positions)| {
        share_free(&format!("1k-val-{house}"), &houses[house], LOCOBOT, positions)
    });
    assert_share("free LoCoBot starts", total(shares), 0.995);
}

#[test]
fn stretch_start_positions_are_free() {
    let file = data_set("roseh-procthor-100k-history/tiny-val.jsonl.gz");
    let folder = data_set("kunalmessi10-procthor-100k-eval");
    let (Some(file), Some(folder)) = (file, folder) else { return };
    let houses = lines(&file);
    let files = ["explorehouse", "fetch2roomtype", "objectnavtype"];
    let episodes = files.iter().flat_map(|kind| {
        lines(&folder.join(format!("tinyval_June8_procthor_100k_{kind}_val.jsonl.gz")))
    });
    let positions = by_house(episodes.filter_map(|line| {
        let episode: Value = serde_json::from_str(&line).expect("JSON");
        let house = episode["house_number"].as_u64().expect("a line number") as usize;
        (house < houses.len()).then(|| (house, xz(&episode["agent_starting_position"])))
    }));
    let shares = positions.iter().map(|(&house, positions)| {
        share_free(&format!("tiny-val-{house}"), &houses[house], STRETCH, positions)
    });
    assert_share("free Stretch starts", total(shares), 0.995);
}

/// Houses that AI2-THOR's own generator found navigable.
const RECORDED_HOUSES: [&str; 7] = [
    "ram81-procthor-100k-history/attr-onav-1k-train-1000.jsonl.gz",
    "ram81-procthor-100k-history/attr-onav-1k-val-100.jsonl.gz",
    "ram81-procthor-100k-history/uniform-hard-val-75.jsonl.gz",
    "ram81-procthor-1k/train.jsonl.gz",
    "ram81-procthor-1k/val.jsonl.gz",
    "roseh-procthor-100k-history/tiny-train.jsonl.gz",
    "roseh-procthor-100k-history/tiny-val.jsonl.gz",
];

/// Starts that are free, and houses all of whose rooms are reached from there.
fn starts_and_connected(files: &[(String, Vec<String>)]) -> [[usize; 2]; 2] {
    let (mut starts, mut connected) = ([0, 0], [0, 0]);
    for (file, lines) in files {
        for (i, line) in lines.iter().enumerate() {
            let name = format!("{file}:{i}");
            let house = house_of(&name, line);
            let Some(start) = house.start else { continue };
            let start_m = [start.position_m[0], start.position_m[2]];
            let count = share_free(&name, line, AgentBody::DEFAULT, &[start_m]);
            starts = total([starts, count].into_iter());
            let navigation = navigation_of(&scene_of(&house), AgentBody::DEFAULT);
            let reached = navigation.reachable_positions(start_m, 0.25).expect("a grid");
            let is_reached =
                |room: &usize| reached.iter().any(|&p| house.room_of(p) == Some(*room));
            let missed: Vec<usize> = (0..house.rooms.len()).filter(|r| !is_reached(r)).collect();
            connected = [connected[0] + usize::from(missed.is_empty()), connected[1] + 1];
            for room in missed {
                eprintln!("unreached: {name} {}", house.rooms[room].id);
            }
        }
    }
    [starts, connected]
}

#[test]
fn recorded_houses_start_free_and_reach_every_room() {
    let found = |name: &&str| data_set(name).map(|path| ((*name).to_owned(), lines(&path)));
    let files: Vec<_> = RECORDED_HOUSES.iter().filter_map(found).collect();
    if files.is_empty() {
        return;
    }
    let [starts, connected] = starts_and_connected(&files);
    assert_share("starts of recorded houses", starts, 0.995);
    assert_share("connected recorded houses", connected, 0.995);
}

#[test]
fn bundled_houses_start_free_and_reach_every_room() {
    let [starts, connected] = starts_and_connected(&[bundled_lines()]);
    assert_share("starts of bundled houses", starts, 1.0);
    assert_share("connected bundled houses", connected, 1.0);
}
