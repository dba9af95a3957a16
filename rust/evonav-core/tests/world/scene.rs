//! Scenes of whole houses: openings are open, walls are not, rebuilds equal builds.

use evonav_core::{
    assets::{
        Catalogue, UnknownAssets,
        material::MaterialKind,
        part::{Part, aabb_of},
    },
    geometry::{Vec2, Vec3, add, polygon_contains, rotate, sub},
    house::{House, HouseDelta, ObjectMove},
    world::scene::{Body, BodyKind, Scene},
};
use proptest::{collection::vec, prelude::*};

use crate::common::solids::holds;

const UNKNOWN: UnknownAssets = UnknownAssets::CategoryDefault;

/// Two rooms of 4 x 4 m side by side, a doorway between them, a window, an L counter and a table
/// with a mug. `DOOR` is replaced by the door's asset, `EMPTY` by whether the wall is open plan.
const TWO_ROOMS: &str = r#"{
  "rooms": [
    {"id": "room|1", "roomType": "Kitchen", "floorMaterial": {"name": "DarkWoodFloors"},
     "floorPolygon": [{"x":0,"y":0,"z":0},{"x":0,"y":0,"z":4},{"x":4,"y":0,"z":4},{"x":4,"y":0,"z":0}]},
    {"id": "room|2", "roomType": "Bedroom", "floorMaterial": {"name": "GreyFloor"},
     "floorPolygon": [{"x":4,"y":0,"z":0},{"x":4,"y":0,"z":4},{"x":8,"y":0,"z":4},{"x":8,"y":0,"z":0}]}
  ],
  "walls": [
    {"id":"wall|1|0.00|0.00|0.00|4.00","roomId":"room|1","material":{"name":"PureWhite"},
     "polygon":[{"x":0,"y":0,"z":0},{"x":0,"y":0,"z":4},{"x":0,"y":2.5,"z":0},{"x":0,"y":2.5,"z":4}]},
    {"id":"wall|1|4.00|0.00|4.00|4.00","roomId":"room|1","material":{"name":"RedBrick"},"empty":EMPTY,
     "polygon":[{"x":4,"y":0,"z":4},{"x":4,"y":0,"z":0},{"x":4,"y":2.5,"z":4},{"x":4,"y":2.5,"z":0}]},
    {"id":"wall|2|4.00|0.00|4.00|4.00","roomId":"room|2","material":{"name":"PureWhite"},"empty":EMPTY,
     "polygon":[{"x":4,"y":0,"z":0},{"x":4,"y":0,"z":4},{"x":4,"y":2.5,"z":0},{"x":4,"y":2.5,"z":4}]},
    {"id":"wall|exterior|0.00|0.00|0.00|4.00","roomId":"exterior","material":{"name":"PureWhite"},
     "polygon":[{"x":0,"y":0,"z":4},{"x":0,"y":0,"z":0},{"x":0,"y":2.5,"z":4},{"x":0,"y":2.5,"z":0}]}
  ],
  "doors": [
    {"id":"door|1|2","room0":"room|1","room1":"room|2","wall0":"wall|1|4.00|0.00|4.00|4.00",
     "wall1":"wall|2|4.00|0.00|4.00|4.00","assetId":"DOOR","openable":true,"openness":OPENNESS,
     "assetPosition":{"x":1.5,"y":1.05,"z":0},
     "holePolygon":[{"x":1,"y":0,"z":0},{"x":2,"y":2.1,"z":0}]}
  ],
  "windows": [
    {"id":"window|1|0","room0":"room|1","room1":"room|1","wall0":"wall|1|0.00|0.00|0.00|4.00",
     "wall1":"wall|exterior|0.00|0.00|0.00|4.00","assetId":"Window_Fixed_36x48",
     "assetPosition":{"x":2,"y":1.5,"z":0},
     "holePolygon":[{"x":1.5,"y":1,"z":0},{"x":2.5,"y":2,"z":0}]}
  ],
  "objects": [
    {"id":"1|0","assetId":"Countertop_L_6x6","position":{"x":1.0,"y":0.472,"z":1.0},
     "rotation":{"x":0,"y":90,"z":0},"kinematic":true},
    {"id":"1|1","assetId":"Dining_Table_201_1","position":{"x":6,"y":0.34,"z":2},
     "rotation":{"x":0,"y":30,"z":0},"kinematic":true,
     "children":[{"id":"small|1|1","assetId":"Mug_1","position":{"x":6,"y":0.8,"z":2},
                  "rotation":{"x":0,"y":0,"z":0},"kinematic":false}]}
  ],
  "proceduralParameters": {"ceilingMaterial": {"name": "PureWhite"}},
  "metadata": {"schema": "1.0.0", "agent": {"position": {"x":2,"y":0.95,"z":3},
    "rotation": {"x":0,"y":0,"z":0}, "standing": true, "horizon": 30}}
}"#;

fn two_rooms(door: &str, openness: &str, is_open_plan: bool) -> (House, Scene) {
    let json = TWO_ROOMS
        .replace("DOOR", door)
        .replace("OPENNESS", openness)
        .replace("EMPTY", if is_open_plan { "true" } else { "false" });
    let house = House::from_json("two rooms", &json).expect("a valid house");
    let scene = Scene::build(&house, Catalogue::bundled(), UNKNOWN).expect("known assets");
    (house, scene)
}

/// Whether the segment meets a part, by sampling it every half millimetre.
fn is_blocked(scene: &Scene, from_m: Vec3, to_m: Vec3, kinds: &[BodyKind]) -> bool {
    let length = sub(to_m, from_m).iter().map(|d| d * d).sum::<f64>().sqrt();
    let steps = (length / 0.0005).ceil() as usize;
    let bodies = scene.bodies.iter().filter(|body| kinds.contains(&body.kind));
    let parts: Vec<&Part> = bodies.flat_map(|body| &body.parts).collect();
    (0..=steps).any(|i| {
        let t = i as f64 / steps as f64;
        let point = add(from_m, sub(to_m, from_m).map(|d| d * t));
        parts.iter().any(|part| holds(part, point))
    })
}

const BUILT: [BodyKind; 3] = [BodyKind::Wall, BodyKind::Door, BodyKind::Window];

#[test]
fn a_ray_passes_through_an_open_door_and_not_beside_it() {
    // wall0 runs from z = 4 to z = 0: its hole at 1..2 m is at z = 2..3.
    let (_, scene) = two_rooms("Doorway_1", "1", false);
    assert!(!is_blocked(&scene, [3.0, 1.0, 2.5], [5.0, 1.0, 2.5], &BUILT));
    assert!(is_blocked(&scene, [3.0, 1.0, 1.5], [5.0, 1.0, 1.5], &BUILT));
    assert!(is_blocked(&scene, [3.0, 2.3, 2.5], [5.0, 2.3, 2.5], &BUILT), "the lintel");
    let (_, closed) = two_rooms("Doorway_1", "0", false);
    assert!(is_blocked(&closed, [3.0, 1.0, 2.5], [5.0, 1.0, 2.5], &BUILT));
    let (_, frame) = two_rooms("Doorframe_1", "0", false);
    assert!(!is_blocked(&frame, [3.0, 1.0, 2.5], [5.0, 1.0, 2.5], &BUILT));
}

#[test]
fn the_leaf_stands_in_the_room_that_the_generator_keeps_free() {
    let (_, scene) = two_rooms("Doorway_1", "1", false);
    let door = scene.bodies.iter().find(|b| b.kind == BodyKind::Door).expect("a door");
    // wall0 runs towards -z; its left is +x.
    assert!(door.aabb.max_m[0] > 4.8 && door.aabb.min_m[0] > 3.8, "{:?}", door.aabb);
    assert_eq!(door.category, "Doorway");
}

#[test]
fn glazed_doors_are_solid_as_wooden_ones_and_have_bars() {
    for openness in ["0", "0.4"] {
        let [glazed, wooden] = ["Doorway_3", "Doorway_1"].map(|door| {
            let (_, scene) = two_rooms(door, openness, false);
            scene.bodies.into_iter().find(|b| b.kind == BodyKind::Door).expect("a door")
        });
        let solids = |door: &Body| -> Vec<_> {
            door.parts.iter().map(|part| (part.primitive, part.centre_m, part.rotation)).collect()
        };
        assert_eq!(solids(&glazed), solids(&wooden));
        let num_panes = |door: &Body| {
            door.parts.iter().filter(|part| part.material.kind == MaterialKind::Pane).count()
        };
        // The board and both panels, but not frame and handle.
        assert_eq!([num_panes(&glazed), num_panes(&wooden)], [3, 0]);
        // Two sides, foot and head, two bars upright and four across.
        assert_eq!([glazed.trim.len(), wooden.trim.len()], [10, 0]);
        let bounds = aabb_of(&glazed.trim);
        for axis in 0..3 {
            assert!(bounds.min_m[axis] >= glazed.aabb.min_m[axis] - 0.01, "{bounds:?}");
            assert!(bounds.max_m[axis] <= glazed.aabb.max_m[axis] + 0.01, "{bounds:?}");
        }
    }
}

#[test]
fn windows_close_their_hole_and_open_plan_walls_are_not_there() {
    let (_, scene) = two_rooms("Doorway_1", "1", false);
    assert!(is_blocked(&scene, [-1.0, 1.4, 1.9], [1.0, 1.4, 1.9], &[BodyKind::Window]));
    assert!(!is_blocked(&scene, [-1.0, 1.4, 1.9], [1.0, 1.4, 1.9], &[BodyKind::Wall]));
    let (_, open) = two_rooms("Doorframe_1", "1", true);
    assert!(!is_blocked(&open, [3.0, 1.0, 1.5], [5.0, 1.0, 1.5], &BUILT));
}

#[test]
fn sides_of_a_wall_keep_their_own_colour_and_room() {
    let (_, scene) = two_rooms("Doorway_1", "1", false);
    let wall = |id: &str| scene.bodies.iter().find(|b| b.id == id).expect("a wall");
    let (brick, white) = (wall("wall|1|4.00|0.00|4.00|4.00"), wall("wall|2|4.00|0.00|4.00|4.00"));
    assert!(brick.aabb.max_m[0] <= 4.0 && white.aabb.min_m[0] >= 4.0);
    assert_ne!(brick.parts[0].colour, white.parts[0].colour);
    let outer = wall("wall|exterior|0.00|0.00|0.00|4.00");
    assert!(outer.aabb.max_m[0] <= 0.0);
}

#[test]
fn the_corner_of_a_turned_counter_is_free() {
    let (_, scene) = two_rooms("Doorway_1", "1", false);
    let counter = &scene.bodies[scene.first_object];
    // At yaw 90 degrees its back (-z) is at -x and its wing (+x) at -z.
    let filled = |x: f64, z: f64| counter.parts.iter().any(|part| holds(part, [x, 0.4, z]));
    assert!(filled(0.3, 1.5) && filled(1.5, 0.3) && !filled(1.5, 1.5));
    let corner = rotate(&counter.oriented.rotation, counter.oriented.half_m);
    assert!((corner[0].abs() - counter.oriented.half_m[2]).abs() < 1e-9);
}

#[test]
fn a_rebuilt_scene_is_the_built_scene() {
    let (house, scene) = two_rooms("Doorway_1", "1", false);
    let moves = vec![
        ObjectMove {
            id: "1|1".to_owned(),
            position_m: [6.5, 0.34, 2.2],
            rotation_deg: [0.0, 120.0, 0.0],
            parent: None,
        },
        ObjectMove {
            id: "small|1|1".to_owned(),
            position_m: [1.0, 0.99, 0.3],
            rotation_deg: [0.0, 45.0, 0.0],
            parent: Some("1|0".to_owned()),
        },
    ];
    let moved: Vec<String> = moves.iter().map(|m| m.id.clone()).collect();
    let after = house.apply(&HouseDelta { moves, ..HouseDelta::default() }).expect("known objects");
    let indices: Vec<usize> = moved.iter().filter_map(|id| after.object_index(id)).collect();
    let catalogue = Catalogue::bundled();
    let rebuilt = scene.rebuild(&after, catalogue, UNKNOWN, &indices).expect("known assets");
    let built = Scene::build(&after, catalogue, UNKNOWN).expect("known assets");
    assert_eq!(rebuilt, built);
    assert_ne!(rebuilt, scene);
}

#[test]
fn children_fall_onto_what_they_stand_on_and_with_it() {
    let (house, scene) = two_rooms("Doorway_1", "1", false);
    let [table, mug] = ["1|1", "small|1|1"].map(|id| {
        let index = house.object_index(id).expect("an object");
        &scene.bodies[scene.first_object + index]
    });
    assert!((mug.aabb.min_m[1] - table.aabb.max_m[1]).abs() < 1e-9, "{:?}", mug.aabb);
    let lower = ObjectMove {
        id: "1|1".to_owned(),
        position_m: [6.0, 0.3, 2.0],
        rotation_deg: [0.0, 30.0, 0.0],
        parent: None,
    };
    let after = house
        .apply(&HouseDelta { moves: vec![lower], ..HouseDelta::default() })
        .expect("a known object");
    let (catalogue, index) = (Catalogue::bundled(), after.object_index("1|1").expect("there"));
    let rebuilt = scene.rebuild(&after, catalogue, UNKNOWN, &[index]).expect("known assets");
    assert_eq!(rebuilt, Scene::build(&after, catalogue, UNKNOWN).expect("known assets"));
}

#[test]
fn floors_of_slanted_rooms_are_covered() {
    let polygon: [Vec2; 4] = [[0.0, 0.0], [0.0, 4.0], [4.0, 5.5], [4.0, 0.0]];
    let corners: Vec<String> =
        polygon.iter().map(|[x, z]| format!(r#"{{"x":{x},"y":0,"z":{z}}}"#)).collect();
    let json = format!(
        r#"{{"rooms":[{{"id":"room|1","roomType":"Bedroom","floorMaterial":"Wood","floorPolygon":[{}]}}],
        "walls":[],"doors":[],"windows":[],"objects":[],"proceduralParameters":{{}},"metadata":{{}}}}"#,
        corners.join(",")
    );
    let house = House::from_json("slanted", &json).expect("a valid house");
    let scene = Scene::build(&house, Catalogue::bundled(), UNKNOWN).expect("no objects");
    let floor = &scene.bodies[0];
    for i in 0..39 {
        for j in 0..56 {
            let [x, z] = [0.053 + 0.1 * f64::from(i), 0.057 + 0.1 * f64::from(j)];
            let is_covered = floor.parts.iter().any(|part| holds(part, [x, -0.01, z]));
            assert!(is_covered || !polygon_contains(&polygon, [x, z]), "{x} {z}");
        }
    }
    assert_eq!(scene.bodies[1].kind, BodyKind::Ceiling);
}

/// A house of one room with the given floor and, along its first edge, holes `[from, to, low, high]`.
fn one_room(floor_m: &[Vec2], holes_m: &[[f64; 4]]) -> House {
    let corners: Vec<String> =
        floor_m.iter().map(|[x, z]| format!(r#"{{"x":{x},"y":0,"z":{z}}}"#)).collect();
    let [a, b] = [floor_m[0], floor_m[1]];
    let foot = |y: f64| {
        format!(r#"{{"x":{},"y":{y},"z":{}}},{{"x":{},"y":{y},"z":{}}}"#, a[0], a[1], b[0], b[1])
    };
    let windows: Vec<String> = holes_m
        .iter()
        .enumerate()
        .map(|(i, [from, to, low, high])| {
            format!(
                r#"{{"id":"window|{i}","room0":"room|1","room1":"room|1","wall0":"wall|1",
                "wall1":"wall|1","assetId":"Window_Fixed_36x48","assetPosition":{{"x":1,"y":1,"z":0}},
                "holePolygon":[{{"x":{from},"y":{low},"z":0}},{{"x":{to},"y":{high},"z":0}}]}}"#
            )
        })
        .collect();
    let json = format!(
        r#"{{"rooms":[{{"id":"room|1","roomType":"Bedroom","floorMaterial":"Wood","floorPolygon":[{}]}}],
        "walls":[{{"id":"wall|1","roomId":"room|1","material":"Wood","polygon":[{},{}]}}],"doors":[],
        "windows":[{}],"objects":[],"proceduralParameters":{{}},"metadata":{{}}}}"#,
        corners.join(","),
        foot(0.0),
        foot(2.5),
        windows.join(",")
    );
    House::from_json("one room", &json).expect("a valid house")
}

proptest! {
    /// A point of the wall's plane is solid exactly where no hole holds it; holes may overlap.
    #[test]
    fn walls_are_solid_outside_their_holes(
        holes in vec([0.0..3.0, 0.05..1.0, 0.0..1.5, 0.05..1.0], 0..5),
        points in vec([0.001..3.999, 0.001..2.499], 40),
    ) {
        let holes: Vec<[f64; 4]> = holes.iter().map(|&[a, w, y, h]| [a, a + w, y, y + h]).collect();
        let floor = [[1.0, 1.0], [1.0, 5.0], [4.0, 5.0], [4.0, 1.0]];
        let house = one_room(&floor, &holes);
        let scene = Scene::build(&house, Catalogue::bundled(), UNKNOWN).expect("no objects");
        let wall = scene.bodies.iter().find(|body| body.kind == BodyKind::Wall).expect("a wall");
        for [along, up] in points {
            let is_hole = holes
                .iter()
                .any(|&[from, to, low, high]| from < along && along < to && low < up && up < high);
            let is_edge = holes.iter().any(|hole| {
                let [from, to, low, high] = hole;
                [along - from, along - to, up - low, up - high].iter().any(|gap| gap.abs() < 1e-5)
            });
            let is_solid = wall.parts.iter().any(|part| holds(part, [1.002, up, 1.0 + along]));
            prop_assert!(is_edge || is_solid != is_hole, "{along} {up} {holes:?}");
        }
    }

    /// Floors cover their polygon and nothing else: a random comb of rectangular teeth.
    #[test]
    fn floors_cover_their_polygon_exactly(
        teeth in vec([0.3..2.0, 0.5..4.0], 1..6),
        points in vec([-0.5..11.0, -0.5..4.5], 60),
    ) {
        let mut polygon: Vec<Vec2> = vec![[0.0, 0.0]];
        let mut x = 0.0;
        for &[width, height] in &teeth {
            polygon.extend([[x, height], [x + width, height]]);
            x += width;
        }
        polygon.push([x, 0.0]);
        let scene = Scene::build(&one_room(&polygon, &[]), Catalogue::bundled(), UNKNOWN)
            .expect("no objects");
        for point in points {
            let is_floor = scene.bodies[0].parts.iter().any(|p| holds(p, [point[0], -0.01, point[1]]));
            let is_edge = teeth.iter().any(|[_, height]| (point[1] - height).abs() < 1e-6);
            prop_assert!(is_edge || is_floor == polygon_contains(&polygon, point), "{point:?}");
        }
    }
}
