//! Where `random_spawn` and `settled` put things, judged point by point from the definition of the shapes.

use std::f64::consts::PI;

use crate::common::solids::holds;
use evonav_core::{
    assets::{
        Catalogue, UnknownAssets,
        part::{Part, Primitive},
    },
    geometry::{Vec3, sub},
    house::House,
    world::{
        layout::{SpawnRequest, Spawned, random_spawn, settled},
        scene::{Body, BodyKind, Scene},
    },
};
use proptest::prelude::*;
use serde_json::{Value, json};

const HOUSE: &str = include_str!("../data/house_100_objects.json");

fn house_with(extra: Vec<Value>) -> House {
    let mut document: Value = serde_json::from_str(HOUSE).expect("JSON");
    document["objects"].as_array_mut().expect("a list").extend(extra);
    House::from_json("test", &document.to_string()).expect("a house")
}

fn object(id: &str, asset_id: &str, position_m: Vec3, rotation_deg: Vec3) -> Value {
    let vector = |[x, y, z]: Vec3| json!({"x": x, "y": y, "z": z});
    json!({"id": id, "assetId": asset_id, "position": vector(position_m),
        "rotation": vector(rotation_deg), "kinematic": false})
}

fn scene_of(house: &House) -> Scene {
    Scene::build(house, Catalogue::bundled(), UnknownAssets::Error).expect("known assets")
}

fn request(seed: u64) -> SpawnRequest {
    SpawnRequest {
        seed,
        object_ids: None,
        excluded_object_ids: Vec::new(),
        receptacle_ids: None,
        excluded_receptacles: Vec::new(),
        forces_visible: false,
        allows_floor: false,
        allows_moveable: false,
        num_attempts: 5,
    }
}

fn spawned(house: &House, request: &SpawnRequest) -> Spawned {
    let scene = scene_of(house);
    random_spawn(house, Catalogue::bundled(), UnknownAssets::Error, &scene, request)
        .expect("a sound request")
}

fn body<'a>(scene: &'a Scene, id: &str) -> &'a Body {
    scene.bodies.iter().find(|body| body.id == id).expect("a body")
}

/// Whether a point lies in a part as it is drawn: polygons inscribed in the ellipses of its definition.
fn holds_drawn(part: &Part, point_m: Vec3) -> bool {
    let offset = sub(point_m, part.centre_m);
    let own: Vec3 = std::array::from_fn(|j| (0..3).map(|i| part.rotation[i][j] * offset[i]).sum());
    match part.primitive {
        // The drawn globe has 12 meridians and 6 bands.
        Primitive::Ellipsoid { half_m } => {
            let inner_m = half_m.map(|half| half * (PI / 12.0).cos().powi(2));
            (0..3).map(|i| (own[i] / inner_m[i]).powi(2)).sum::<f64>() <= 1.0
        }
        Primitive::Frustum { bottom_m, top_m, half_height_m, sides } => {
            let t = 0.5 * (own[1] / half_height_m + 1.0);
            let half_m = [0, 1].map(|i| bottom_m[i] + t * (top_m[i] - bottom_m[i]));
            let ring: Vec<Vec3> = Primitive::ring_m(half_m, 0.0, sides).collect();
            let is_left = |k: usize| {
                let (a, b) = (ring[k], ring[(k + 1) % ring.len()]);
                (b[0] - a[0]) * (own[2] - a[2]) >= (b[2] - a[2]) * (own[0] - a[0])
            };
            (0.0..=1.0).contains(&t) && (0..ring.len()).all(is_left)
        }
        Primitive::Cuboid { .. } | Primitive::Pad { .. } => holds(part, point_m),
    }
}

/// Points of a lattice over what two boxes share around which parts of both bodies share more than
/// `touch_m`: parts that overlap by less only touch.
fn shared_points(a: &Body, b: &Body, touch_m: f64) -> usize {
    const STEPS: usize = 8;
    let low: Vec3 = std::array::from_fn(|i| a.aabb.min_m[i].max(b.aabb.min_m[i]) + touch_m);
    let high: Vec3 = std::array::from_fn(|i| a.aabb.max_m[i].min(b.aabb.max_m[i]) - touch_m);
    if (0..3).any(|i| low[i] >= high[i]) {
        return 0;
    }
    let at = |i: usize, k: usize| low[i] + (high[i] - low[i]) * k as f64 / STEPS as f64;
    let around = |point: Vec3| {
        let shifts = (0..3).flat_map(|i| [(i, -0.5 * touch_m), (i, 0.5 * touch_m)]);
        shifts.map(move |(i, shift_m)| {
            let mut shifted = point;
            shifted[i] += shift_m;
            shifted
        })
    };
    let is_in = |body: &Body, point: Vec3| {
        body.parts.iter().any(|part| around(point).all(|p| holds_drawn(part, p)))
    };
    let lattice = (0..=STEPS)
        .flat_map(|x| (0..=STEPS).flat_map(move |y| (0..=STEPS).map(move |z| [x, y, z])));
    lattice
        .map(|[x, y, z]| [at(0, x), at(1, y), at(2, z)])
        .filter(|&point| is_in(a, point) && is_in(b, point))
        .count()
}

/// Whether a part of `bearer` is right under the middle of `body`, or under one of its quarters.
fn is_borne(body: &Body, bearer: &Body) -> bool {
    let ([x, _, z], [width, _, depth]) = (body.aabb.centre_m(), body.aabb.size_m());
    let offsets = [[0.0, 0.0], [0.35, 0.35], [0.35, -0.35], [-0.35, 0.35], [-0.35, -0.35]];
    offsets.iter().any(|[right, ahead]| {
        let under = [x + right * width, body.aabb.min_m[1] - 0.004, z + ahead * depth];
        bearer.parts.iter().any(|part| holds(part, under))
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    /// Every moved thing rests on its new parent, inside nothing, and can be carried.
    #[test]
    fn things_land_on_receptacles_inside_nothing(seed in any::<u64>()) {
        let house = house_with(Vec::new());
        let found = spawned(&house, &request(seed));
        prop_assert!(found.delta.moves.len() > 10);
        let after = house.apply(&found.delta).unwrap();
        let (scene, catalogue) = (scene_of(&after), Catalogue::bundled());
        for step in &found.delta.moves {
            let index = after.object_index(&step.id).unwrap();
            let asset = catalogue.get(&after.objects[index].asset_id).unwrap();
            let bearer = after.object_index(step.parent.as_ref().unwrap()).unwrap();
            let bearer_asset = catalogue.get(&after.objects[bearer].asset_id).unwrap();
            prop_assert!(asset.is_pickupable);
            prop_assert!(catalogue.can_rest_on(&asset.category, &bearer_asset.category));
            let moved = body(&scene, &step.id);
            prop_assert!(is_borne(moved, body(&scene, step.parent.as_ref().unwrap())), "{}", step.id);
            for other in scene.bodies.iter().filter(|other| other.id != step.id) {
                // Children of the file that hover over their parent are settled in the scene only.
                let was_moved = found.delta.moves.iter().any(|m| m.id == other.id);
                if was_moved || other.kind != BodyKind::Object || after.objects
                    [after.object_index(&other.id).unwrap()].parent.is_none()
                {
                    prop_assert_eq!(shared_points(moved, other, 0.003), 0, "{} in {}", &step.id, &other.id);
                }
            }
        }
    }

    /// Same seed, same bits; ids that are unplaced did not move.
    #[test]
    fn a_seed_decides_everything(seed in any::<u64>()) {
        let house = house_with(Vec::new());
        let found = spawned(&house, &request(seed));
        prop_assert_eq!(&found, &spawned(&house, &request(seed)));
        prop_assert!(found.delta.moves.iter().all(|step| !found.unplaced.contains(&step.id)));
        prop_assert_ne!(found, spawned(&house, &request(seed ^ 1)));
    }
}

#[test]
fn named_things_go_to_named_receptacles_or_to_the_floor_of_a_room() {
    let house = house_with(vec![object("new", "Mug_1", [0.0, -20.0, 0.0], [0.0; 3])]);
    let tables: Vec<String> = house
        .objects
        .iter()
        .filter(|o| {
            Catalogue::bundled().get(&o.asset_id).is_some_and(|a| a.category == "DiningTable")
        })
        .map(|o| o.id.clone())
        .collect();
    let named = SpawnRequest { object_ids: Some(vec!["new".into()]), ..request(3) };
    let on_table = SpawnRequest { receptacle_ids: Some(tables.clone()), ..named.clone() };
    let found = spawned(&house, &on_table);
    assert_eq!(found.delta.moves.len(), 1);
    assert!(tables.contains(found.delta.moves[0].parent.as_ref().unwrap()));

    let every_category: Vec<String> =
        Catalogue::bundled().categories().into_iter().map(str::to_owned).collect();
    let barred = SpawnRequest { excluded_receptacles: every_category, ..named };
    assert_eq!(spawned(&house, &barred).unplaced, ["new"]);
    let floor = SpawnRequest { allows_floor: true, num_attempts: 50, ..barred };
    let step = &spawned(&house, &floor).delta.moves[0];
    assert_eq!(step.parent, None);
    assert!(house.room_of([step.position_m[0], step.position_m[2]]).is_some());
    let after = house.apply(&spawned(&house, &floor).delta).unwrap();
    assert!(body(&scene_of(&after), "new").aabb.min_m[1].abs() < 1e-3);
}

#[test]
fn a_request_without_end_is_refused() {
    let read =
        |num: u64| SpawnRequest::from_json(&format!("{{\"seed\":1,\"num_attempts\":{num}}}"));
    assert_eq!(read(1000).expect("the most").num_attempts, 1000);
    let error = read(u64::MAX).expect_err("too many").to_string();
    assert!(error.starts_with("argument `num_attempts` is 18446744073709551615"), "{error}");
}

#[test]
fn a_carried_thing_takes_along_what_stands_on_it() {
    let plate = object("plate", "Plate_1", [0.0, -20.0, 0.0], [0.0; 3]);
    let mut document: Value = plate;
    document["children"] = json!([object("fork", "Fork_1", [0.02, -19.9, 0.03], [0.0, 20.0, 0.0])]);
    let house = house_with(vec![document]);
    let wanted = SpawnRequest { object_ids: Some(vec!["plate".into()]), ..request(5) };
    let found = spawned(&house, &wanted);
    let place = |id: &str| found.delta.moves.iter().find(|step| step.id == id).unwrap();
    let (plate, fork) = (place("plate"), place("fork"));
    let offset: Vec3 = std::array::from_fn(|i| fork.position_m[i] - plate.position_m[i]);
    assert!((offset[0].hypot(offset[2]) - 0.02_f64.hypot(0.03)).abs() < 3e-4, "{offset:?}");
    assert!((offset[1] - 0.1).abs() < 3e-4);
    let turned = (fork.rotation_deg[1] - plate.rotation_deg[1]).rem_euclid(360.0);
    assert!((turned - 20.0).abs() < 1e-2, "{turned}");
    assert_eq!(fork.parent.as_deref(), Some("plate"));
}

#[test]
fn requests_that_name_what_is_not_there_are_errors() {
    let (house, catalogue) = (house_with(Vec::new()), Catalogue::bundled());
    let scene = scene_of(&house);
    for wrong in [
        SpawnRequest { object_ids: Some(vec!["nothing".into()]), ..request(0) },
        SpawnRequest { excluded_object_ids: vec!["nothing".into()], ..request(0) },
        SpawnRequest { receptacle_ids: Some(vec!["nothing".into()]), ..request(0) },
    ] {
        let error = random_spawn(&house, catalogue, UnknownAssets::Error, &scene, &wrong);
        assert!(error.unwrap_err().to_string().contains("nothing"));
    }
    assert!(SpawnRequest::from_json("{\"seed\": -1}").is_err());
}

#[test]
fn what_hangs_in_the_air_comes_down_and_a_bat_askew_lies_down() {
    let house = house_with(Vec::new());
    let calm = settled(&house, Catalogue::bundled(), UnknownAssets::Error, &scene_of(&house));
    assert_eq!(calm.unwrap().moves, []);

    let sofa = house.objects.iter().find(|o| o.asset_id.contains("Dining_Table")).unwrap();
    let [x, _, z] = sofa.position_m;
    let floor = free_floor(&house);
    let dropped = house_with(vec![
        object("bat", "BaseballBat_1", [floor[0], 3.0, floor[1]], [4.0, 33.0, 0.0]),
        object("mug", "Mug_1", [x, 3.0, z], [4.0, 50.0, 0.0]),
    ]);
    let delta =
        settled(&dropped, Catalogue::bundled(), UnknownAssets::Error, &scene_of(&dropped)).unwrap();
    assert_eq!(delta.moves.len(), 2);
    let after = dropped.apply(&delta).unwrap();
    let scene = scene_of(&after);
    let bat = body(&scene, "bat");
    assert!(bat.aabb.min_m[1].abs() < 1e-3 && bat.aabb.max_m[1] < 0.15, "{:?}", bat.aabb);
    for other in scene.bodies.iter().filter(|other| other.id != "bat") {
        assert_eq!(shared_points(bat, other, 0.003), 0, "in {}", other.id);
    }
    let mug = body(&scene, "mug");
    let bearer = &delta.moves.iter().find(|step| step.id == "mug").unwrap().parent;
    assert!(is_borne(mug, body(&scene, bearer.as_ref().unwrap())));
    let again = settled(&after, Catalogue::bundled(), UnknownAssets::Error, &scene).unwrap();
    assert_eq!(again.moves, []);
}

/// Middle of a square of 2.4 m without objects.
fn free_floor(house: &House) -> [f64; 2] {
    let scene = scene_of(house);
    let is_free = |x: f64, z: f64| {
        let clear = |body: &Body| {
            matches!(body.kind, BodyKind::Floor | BodyKind::Ceiling)
                || body.aabb.min_m[0] > x + 1.2
                || body.aabb.max_m[0] < x - 1.2
                || body.aabb.min_m[2] > z + 1.2
                || body.aabb.max_m[2] < z - 1.2
        };
        house.room_of([x, z]).is_some() && scene.bodies.iter().all(clear)
    };
    let places =
        (0..200).flat_map(|i| (0..200).map(move |j| [0.1 * f64::from(i), 0.1 * f64::from(j)]));
    places.into_iter().find(|&[x, z]| is_free(x, z)).expect("the house has free floor")
}
