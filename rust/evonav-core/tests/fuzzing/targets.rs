//! What must hold of any bytes that the readers of the core are given. `rust/evonav-fuzz` looks for bytes of
//! which it does not; the tests beside this file try those that it has found.

use std::sync::{Arc, OnceLock};

use evonav_core::{
    Error,
    assets::{Catalogue, UnknownAssets},
    generation::{Overrides, Parameters},
    geometry::{Aabb, Pose, Vec2, distance_2d_m},
    house::{House, HouseDelta, Lamp, ObjectMove},
    perception::mini::network::Network,
    sensors::raster::{FrameBuffer, Style},
    simulator::{EmbeddedSimulator, SimulatorConfig},
    world::{
        appearance::Appearance,
        inspection::{Tolerances, inspect_houses},
        layout::{SpawnRequest, random_spawn},
        navigation::{AgentBody, path_length_m},
    },
};
use serde_json::Value;

/// A house of two rooms with a few objects.
pub const TWO_ROOMS: &str = include_str!("../data/fuzzing/world/two_rooms.json");

const CONFIG: SimulatorConfig = SimulatorConfig {
    image_px: [24, 16],
    vertical_fov_rad: 1.5,
    clip_m: [0.1, 20.0],
    camera_height_m: 1.5,
    agent: AgentBody { radius_m: 0.2, height_m: 1.8 },
    unknown: UnknownAssets::CategoryDefault,
    style: Style::Plain,
};
/// Houses within these limits are built; it takes some milliseconds.
const MAX_EXTENT_M: f64 = 20.0;
const MAX_BODIES: usize = 40;
/// Longest error: the name of a field or object can be 512 bytes long, and stands in it more than once.
const MAX_MESSAGE: usize = 5000;

/// A target's name and function, which panics where something does not hold, and returns whether a fuzzer
/// should go on from these bytes.
pub type Target = (&'static str, fn(&[u8]) -> bool);

/// All targets. The corpus of each is the folder of its name in `tests/data/fuzzing`.
pub const TARGETS: [Target; 5] = [
    ("house", house),
    ("lit", lit),
    ("requests", requests),
    ("weights", weights),
    ("world", world),
];

/// The reader of houses agrees with `serde_json` on what is JSON and on its values, and what it reads it
/// writes and reads again.
pub fn house(data: &[u8]) -> bool {
    let Ok(text) = str::from_utf8(data) else { return true };
    let plain: Result<Value, _> = serde_json::from_str(text);
    match House::from_json("fuzzed", text) {
        Ok(house) => {
            let plain = plain.expect("a house is JSON");
            assert_eq!(serde_json::from_str(&house.to_json()).ok(), Some(plain), "the document");
            assert_eq!(House::from_json("fuzzed", &house.to_json()).as_ref(), Ok(&house));
            assert_eq!(house.apply(&HouseDelta::default()).as_ref(), Ok(&house), "no change");
            let lamps = house.lamps();
            let is_finite = |lamp: &Lamp| {
                lamp.position_m.iter().all(|v| v.is_finite())
                    && lamp.power.iter().all(|v| v.is_finite())
            };
            assert!(lamps.iter().all(is_finite), "{lamps:?}");
        }
        Err(error) => {
            check(&error);
            let Error::House { field, message, .. } = error else { panic!("{error}") };
            let is_unread = field == "JSON";
            match plain {
                Err(_) => assert!(is_unread, "{message} of what is no JSON"),
                Ok(plain) if is_unread => assert!(
                    num_members(text) > num_members(&plain.to_string()),
                    "{message} of JSON without repeated keys"
                ),
                Ok(_) => {}
            }
        }
    }
    true
}

/// Count the members of all objects of a JSON text: its colons outside of strings.
fn num_members(json: &str) -> usize {
    let (mut num, mut is_text, mut is_escaped) = (0, false, false);
    for byte in json.bytes() {
        let is_quote = byte == b'"' && !is_escaped;
        num += usize::from(byte == b':' && !is_text);
        is_escaped = is_text && byte == b'\\' && !is_escaped;
        is_text ^= is_quote;
    }
    num
}

/// Every reader of a request accepts it or says why not, and what is accepted can be carried out.
pub fn requests(data: &[u8]) -> bool {
    let Ok(text) = str::from_utf8(data) else { return true };
    let world = two_rooms();
    if let Some(delta) = accepted(HouseDelta::from_json(text)) {
        assert_eq!(HouseDelta::from_json(&delta.to_json()).as_ref(), Ok(&delta));
        accepted(world.house().apply(&delta));
    }
    if let Some(appearance) = accepted(Appearance::from_json(text)) {
        let look = world.with_look(&appearance);
        assert_eq!(look.mesh().faces().len(), world.mesh().faces().len());
    }
    if let Some(request) = accepted(SpawnRequest::from_json(text)) {
        let request = SpawnRequest { num_attempts: request.num_attempts.min(4), ..request };
        let (house, scene) = (world.house(), world.scene());
        if let Some(spawned) =
            accepted(random_spawn(house, Catalogue::bundled(), CONFIG.unknown, scene, &request))
        {
            house.apply(&spawned.delta).expect("a house after a spawn");
        }
    }
    if let Some(parameters) = accepted(Parameters::from_json(text)) {
        assert_eq!(Parameters::from_json(&parameters.to_json()), Ok(parameters));
    }
    accepted(Overrides::from_json(text));
    true
}

/// A weights file is read or refused.
pub fn weights(data: &[u8]) -> bool {
    accepted(Network::read(data));
    true
}

/// A house is built, rendered, walked through and changed. Returns whether it was, or was refused by the
/// simulator: what is no house, or no small one, teaches nothing here.
pub fn world(data: &[u8]) -> bool {
    let Some(house) = small_house(data) else { return false };
    let Some(world) = accepted(EmbeddedSimulator::new(house, CONFIG)) else { return true };
    let scene = world.scene();
    for body in scene.bodies.iter().filter(|body| !body.parts.is_empty()) {
        assert!(is_box(&body.aabb), "{body:?}");
    }
    let mut corners = world.mesh().triangles().flat_map(|triangle| triangle.vertices_m);
    assert!(corners.all(|corner| corner.iter().all(|v| v.is_finite())), "a corner of the mesh");
    let start = world.start();
    let start_m = [start.position_m[0], start.position_m[2]];
    look_around(&world, &start);
    walk(&world, start_m);
    let tolerances = Tolerances { touch_m: 0.01, rest_m: 0.02 };
    let house = world.house();
    let findings =
        accepted(inspect_houses(house, house, Catalogue::bundled(), CONFIG.unknown, tolerances));
    assert!(findings.is_none_or(|all| all.iter().all(|one| one.amount_m.is_finite())));
    rearrange(&world);
    true
}

/// A house is lit, and drawn in its light, which takes longer than all of [`world`]. Returns as there.
pub fn lit(data: &[u8]) -> bool {
    let Some(house) = small_house(data) else { return false };
    let config = SimulatorConfig { style: Style::Default, ..CONFIG };
    let Some(world) = accepted(EmbeddedSimulator::new(house, config)) else { return true };
    look_around(&world, &world.start());
    true
}

/// All pixels have a depth and a body, or neither.
fn look_around(world: &EmbeddedSimulator, start: &Pose) {
    let mut frame = FrameBuffer::default();
    for (turn_rad, has_colours) in [(0.0, true), (2.0, false), (4.0, false)] {
        let pose = Pose { yaw_rad: start.yaw_rad + turn_rad, ..*start };
        let view = world.view(&pose);
        world.render(&view, world.want(has_colours, true), &mut frame).expect("a view");
        let num_bodies = world.bodies().len() as i32;
        for (&depth_m, &body) in frame.depth_m.iter().zip(&frame.instances) {
            assert!(!depth_m.is_nan() && depth_m > 0.0, "a depth of {depth_m}");
            assert!((0..=num_bodies).contains(&body), "body {body} of {num_bodies}");
            assert_eq!(depth_m.is_finite(), body > 0, "a depth of {depth_m} of body {body}");
        }
        let agent_m = [pose.position_m[0], pose.position_m[2]];
        let seen = world.visible_bodies(&view, agent_m, 1.5).expect("a view");
        assert!(seen.iter().all(|&body| body < world.bodies().len()));
    }
}

/// Paths agree with distances, lead through free space, and are no shorter than a straight line.
fn walk(world: &EmbeddedSimulator, start_m: Vec2) {
    let navigation = world.navigation();
    assert!(navigation.is_free(start_m), "the start {start_m:?}");
    let (spec, cells) = world.occupancy(0.25).expect("a map");
    assert_eq!(cells.len(), spec.len());
    let reached_m = navigation.reachable_positions(start_m, 0.5).expect("a grid");
    assert!(reached_m.iter().all(|&point_m| navigation.is_free(point_m)));
    let house = world.house();
    let rooms = house.rooms.iter().map(|room| room.polygon_m[0]);
    let objects = house.objects.iter().map(|object| [object.position_m[0], object.position_m[2]]);
    // Snapping takes longer than the search: it is done once.
    let targets_m = rooms.chain(objects).take(8).filter_map(|point_m| navigation.snap(point_m));
    let targets_m: Vec<Vec2> = targets_m.collect();
    let lengths_m = navigation.distances_m(start_m, &targets_m);
    let field = navigation.field(start_m).expect("a field of a free point");
    for (&target_m, length_m) in targets_m.iter().zip(lengths_m) {
        let field_m = navigation.field_distance_m(&field, target_m);
        assert!(is_close(field_m, length_m), "{field_m} and {length_m} m to {target_m:?}");
        let Some(path_m) = navigation.shortest_path(start_m, target_m) else {
            assert_eq!(length_m, f64::INFINITY, "no path to {target_m:?}");
            continue;
        };
        let (first_m, last_m) = (path_m[0], path_m[path_m.len() - 1]);
        assert!(is_close(path_length_m(&path_m), length_m), "{path_m:?} of {length_m} m");
        assert!(length_m >= distance_2d_m(first_m, last_m) - 1e-9, "{path_m:?} of {length_m} m");
        let is_clear = |leg: &[Vec2]| navigation.obstacles().is_clear_between(leg[0], leg[1]);
        assert!(path_m.windows(2).all(is_clear), "{path_m:?} touches something");
    }
}

/// Changing a house gives what building the changed house gives.
fn rearrange(world: &EmbeddedSimulator) {
    let house = world.house();
    let Some((first, last)) = house.objects.first().zip(house.objects.last()) else { return };
    let moved = ObjectMove {
        id: last.id.clone(),
        position_m: first.position_m,
        rotation_deg: last.rotation_deg.map(|angle| -angle),
        parent: None,
    };
    let delta = HouseDelta { moves: vec![moved], ..HouseDelta::default() };
    let changed = house.apply(&delta).expect("a house after a move");
    let expected = EmbeddedSimulator::new(changed, CONFIG);
    match (world.apply(&delta), expected) {
        (Ok(found), Ok(expected)) => {
            assert_eq!(found.scene(), expected.scene());
            assert_eq!(found.start(), expected.start());
        }
        (found, expected) => assert_eq!(found.err(), expected.err()),
    }
}

/// Return what a reader has read; check its error otherwise.
fn accepted<T>(read: Result<T, Error>) -> Option<T> {
    read.inspect_err(check).ok()
}

fn check(error: &Error) {
    let length = error.to_string().len();
    assert!(length < MAX_MESSAGE, "an error of {length} bytes");
}

/// Read a house; `None` if it is none, or takes long to build.
fn small_house(data: &[u8]) -> Option<House> {
    let text = str::from_utf8(data).ok()?;
    House::from_json("fuzzed", text).ok().filter(is_small)
}

fn is_small(house: &House) -> bool {
    let num_openings = house.doors.len() + house.windows.len();
    let corners_m = || house.rooms.iter().flat_map(|room| &room.polygon_m);
    let low_m = |axis: usize| corners_m().map(|corner| corner[axis]).fold(f64::INFINITY, f64::min);
    let high_m =
        |axis: usize| corners_m().map(|corner| corner[axis]).fold(f64::NEG_INFINITY, f64::max);
    house.objects.len() + house.walls.len() + num_openings + house.rooms.len() <= MAX_BODIES
        && corners_m().count() <= MAX_BODIES
        && (0..2).all(|axis| high_m(axis) - low_m(axis) <= MAX_EXTENT_M)
}

fn is_box(aabb: &Aabb) -> bool {
    (0..3).all(|i| {
        aabb.min_m[i].is_finite() && aabb.max_m[i].is_finite() && aabb.min_m[i] <= aabb.max_m[i]
    })
}

fn is_close(a: f64, b: f64) -> bool {
    a == b || (a - b).abs() < 1e-6
}

fn two_rooms() -> &'static Arc<EmbeddedSimulator> {
    static WORLD: OnceLock<Arc<EmbeddedSimulator>> = OnceLock::new();
    WORLD.get_or_init(|| {
        let house = House::from_json("two rooms", TWO_ROOMS).expect("a house");
        Arc::new(EmbeddedSimulator::new(house, CONFIG).expect("a simulator"))
    })
}
