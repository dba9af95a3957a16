//! What every house has, held to plain looks at its file: no code is shared with the checks that
//! the maker makes itself, but for the free space.

use std::collections::{BTreeMap, BTreeSet};

use evonav_core::{
    assets::{Asset, Catalogue, Split, UnknownAssets},
    geometry::{Vec2, polygon_area_m2, polygon_contains},
    house::{EXTERIOR, House},
    house_generation::{HouseMaker, HouseParameters, RoomNode, RoomSpec},
    world::{
        inspection::{FindingKind, Tolerances, inspect_houses},
        navigation::{AgentBody, Navigation, NavigationConfig},
        scene::Scene,
    },
};

use super::maker;

fn asset(id: &str) -> &'static Asset {
    Catalogue::bundled().get(id).unwrap()
}

/// Check everything that a house must have, whatever its parameters.
fn check(house: &House) {
    check_rooms(house);
    check_connections(house);
    check_walls(house);
    check_objects(house);
    check_ways(house);
    let again = House::from_json(&house.name, &house.to_json()).unwrap();
    assert_eq!(*house, again, "{}: the text says the same", house.name);
}

/// Rooms do not overlap: points of a fine grid are in one room at most, and areas add up.
fn check_rooms(house: &House) {
    let corners = house.rooms.iter().flat_map(|room| &room.polygon_m);
    let [x_m, z_m] = [0, 1].map(|i| corners.clone().map(|c| c[i]).fold(0.0, f64::max));
    let (step_m, mut area_m2) = (0.31, 0.0);
    let mut x = 0.05;
    while x < x_m {
        let mut z = 0.05;
        while z < z_m {
            let within = house.rooms.iter().filter(|r| polygon_contains(&r.polygon_m, [x, z]));
            let count = within.count();
            assert!(count <= 1, "{}: [{x}, {z}] is in {count} rooms", house.name);
            area_m2 += step_m * step_m * count as f64;
            z += step_m;
        }
        x += step_m;
    }
    let exact_m2: f64 = house.rooms.iter().map(|r| polygon_area_m2(&r.polygon_m).abs()).sum();
    assert!((area_m2 / exact_m2 - 1.0).abs() < 0.2, "{}: {area_m2} {exact_m2}", house.name);
}

/// Doors and open borders connect all rooms; one door leads outside and is closed.
fn check_connections(house: &House) {
    let mut group: BTreeMap<&str, usize> = BTreeMap::new();
    for (index, room) in house.rooms.iter().enumerate() {
        group.insert(&room.id, index);
    }
    let position = |id: &str| id.splitn(3, '|').nth(2).unwrap().to_owned();
    let mut open: BTreeMap<String, Vec<&str>> = BTreeMap::new();
    for wall in house.walls.iter().filter(|wall| wall.is_empty) {
        open.entry(position(&wall.id)).or_default().push(&wall.room_id);
    }
    let doors = house.doors.iter().map(|door| [&*door.room_ids[0], &*door.room_ids[1]]);
    let borders = open.values().map(|rooms| {
        assert_eq!(rooms.len(), 2, "{}: both sides of an open border are empty", house.name);
        [rooms[0], rooms[1]]
    });
    for [a, b] in doors.chain(borders).collect::<Vec<_>>() {
        let (from, to) = (group[a], group[b]);
        group.values_mut().filter(|other| **other == from).for_each(|other| *other = to);
    }
    let groups: BTreeSet<usize> = group.into_values().collect();
    assert_eq!(groups.len(), 1, "{}: all rooms are connected", house.name);
    let outside: Vec<_> = house.doors.iter().filter(|d| d.wall1.contains(EXTERIOR)).collect();
    assert_eq!(outside.len(), 1, "{}", house.name);
    assert_eq!(outside[0].openness, 0.0);
    assert!(house.doors.iter().filter(|d| !d.wall1.contains(EXTERIOR)).all(|d| d.openness == 1.0));
}

/// Every wall has its other side, and holes of one wall are apart.
fn check_walls(house: &House) {
    let ends = |a: Vec2, b: Vec2| {
        let mut ends = [a, b].map(|p| p.map(|v| (v * 1e3).round() as i64));
        ends.sort_unstable();
        ends
    };
    let mut sides: BTreeMap<[[i64; 2]; 2], usize> = BTreeMap::new();
    for wall in &house.walls {
        *sides.entry(ends(wall.from_m, wall.to_m)).or_default() += 1;
    }
    assert!(sides.values().all(|&count| count == 2), "{}: walls have two sides", house.name);
    let openings: Vec<_> = house.doors.iter().chain(&house.windows).collect();
    for (index, one) in openings.iter().enumerate() {
        let wall = house.walls.iter().find(|wall| wall.id == one.wall0).unwrap();
        assert!(!wall.is_empty, "{}: {} is in an open border", house.name, one.id);
        for other in &openings[..index] {
            let is_apart =
                one.wall0 != other.wall0 && one.wall0 != other.wall1 && one.wall1 != other.wall0;
            assert!(is_apart, "{}: {} and {} share a wall", house.name, one.id, other.id);
        }
    }
}

/// Furniture is in its room; nothing touches anything else or hangs in the air; one painting is
/// never there twice.
fn check_objects(house: &House) {
    let mut document: serde_json::Value = serde_json::from_str(&house.to_json()).unwrap();
    document["objects"] = serde_json::json!([]);
    let bare = House::from_json("bare", &document.to_string()).unwrap();
    let tolerances = Tolerances { touch_m: 0.0025, rest_m: 0.02 };
    let unknown = UnknownAssets::Error;
    let catalogue = Catalogue::bundled();
    let findings = inspect_houses(&bare, house, catalogue, unknown, tolerances).unwrap();
    for finding in findings {
        let object = &house.objects[house.object_index(&finding.id).unwrap()];
        let category = asset(&object.asset_id).category.as_str();
        let is_fine = match finding.kind {
            FindingKind::Penetration => category == "Faucet",
            FindingKind::Unsupported => ["Painting", "Television"].contains(&category),
            _ => false,
        };
        assert!(is_fine, "{}: {category} {finding:?}", house.name);
    }
    let mut paintings = BTreeSet::new();
    for object in &house.objects {
        let room =
            object.room.unwrap_or_else(|| panic!("{}: {} in no room", house.name, object.id));
        let number = object.id.trim_start_matches("small|").split('|').next().unwrap();
        assert_eq!(house.rooms[room].id, format!("room|{number}"), "{}", object.id);
        let is_new = paintings.insert(&object.asset_id);
        assert!(is_new || asset(&object.asset_id).category != "Painting");
    }
}

/// The start is free, and every room is reached from it.
fn check_ways(house: &House) {
    let scene = Scene::build(house, Catalogue::bundled(), UnknownAssets::Error).unwrap();
    let config = NavigationConfig::default();
    let navigation = Navigation::build(&scene, AgentBody::DEFAULT, config).unwrap();
    let [x, _, z] = house.start.unwrap().position_m;
    assert!(navigation.is_free([x, z]), "{}: the start is free", house.name);
    let places = navigation.reachable_positions([x, z], 0.25).unwrap();
    for room in &house.rooms {
        let count = places.iter().filter(|p| polygon_contains(&room.polygon_m, **p)).count();
        assert!(count >= 5, "{}: {} has {count} places", house.name, room.id);
    }
}

#[test]
fn houses_of_many_seeds_are_sound() {
    let maker = maker(|_| {});
    for index in 0..150 {
        check(&maker.make(11, index).unwrap());
    }
}

#[test]
fn every_spec_and_split_gives_houses() {
    for split in [Split::Train, Split::Val, Split::Test] {
        for spec in HouseParameters::default().room_specs {
            let maker = maker(|it| {
                it.split = split;
                it.room_specs = vec![spec.clone()];
            });
            let house = maker.make(3, 0).unwrap();
            check(&house);
            assert_eq!(house.rooms.len(), spec.leaves().len());
            let is_allowed = |id: &String| asset(id).split.is_none_or(|own| own == split);
            assert!(house.objects.iter().all(|object| is_allowed(&object.asset_id)));
        }
    }
}

fn room(room_type: &str) -> RoomNode {
    let room_type = Some(room_type.to_owned());
    RoomNode { ratio: 1.0, room_type, is_private: false, rooms: Vec::new() }
}

fn spec(rooms: Vec<RoomNode>, cells: [[usize; 2]; 2]) -> RoomSpec {
    RoomSpec { id: "odd".to_owned(), weight: 1.0, cells: Some(cells), rooms }
}

#[test]
fn odd_parameters_give_sound_houses() {
    let types = ["Kitchen", "LivingRoom", "Bedroom", "Bathroom", "home office"];
    let many: Vec<RoomNode> = types.iter().cycle().take(18).map(|kind| room(kind)).collect();
    let odd: [(&str, HouseMaker); 6] = [
        ("tiny", maker(|it| it.room_specs = vec![spec(vec![room("Bathroom")], [[1, 1]; 2])])),
        ("huge", maker(|it| it.room_specs = vec![spec(many, [[12, 14]; 2])])),
        (
            "of another type",
            maker(|it| it.room_specs = vec![spec(vec![room("shop")], [[3, 4]; 2])]),
        ),
        (
            "empty",
            maker(|it| {
                it.floor_objects.max_per_room = vec![(0, 1.0)];
                it.hung.painting_weights = vec![1.0];
                it.hung.television_rooms.clear();
            }),
        ),
        ("full", maker(|it| it.floor_objects.max_per_room = vec![(20, 1.0)])),
        ("open", maker(|it| (it.doors.open_probability, it.doors.frame_probability) = (1.0, 0.0))),
    ];
    for (name, maker) in odd {
        for index in 0..8 {
            let house = maker.make(5, index).unwrap_or_else(|error| panic!("{name}: {error}"));
            check(&house);
            // ProcTHOR's rules place nothing in rooms of other types.
            let is_bare = ["empty", "of another type"].contains(&name);
            assert_eq!(is_bare, house.objects.is_empty(), "{name}");
        }
    }
}

#[test]
fn a_house_depends_on_seed_and_number_alone() {
    let maker = maker(|_| {});
    let first = maker.make(9, 4).unwrap().to_json();
    maker.make(9, 5).unwrap();
    assert_eq!(maker.make(9, 4).unwrap().to_json(), first);
    assert_eq!(super::maker(|_| {}).make(9, 4).unwrap().to_json(), first);
    let others = [maker.make(9, 3), maker.make(8, 4)].map(|house| house.unwrap().to_json());
    assert!(others.iter().all(|other| *other != first));
}

/// The mix of specs is that of the weights, and the paper's marginals hold: ceilings of 2.5 m and
/// more, one floor material a house in some houses, painted and other walls.
#[test]
fn the_mix_follows_the_parameters() {
    let maker = maker(|it| it.structure.num_candidates = 4);
    let houses: Vec<House> = (0..300).map(|index| maker.make(2, index).unwrap()).collect();
    let share = |is: &dyn Fn(&House) -> bool| {
        houses.iter().filter(|house| is(house)).count() as f64 / houses.len() as f64
    };
    // Weights of ProcTHOR's specs: 4 of 22 for a single room, 5 of 22 for four rooms of one spec.
    let near = |found: f64, expected: f64| (found - expected).abs() < 0.08;
    assert!(near(share(&|house| house.rooms.len() == 1), 4.0 / 22.0));
    assert!(near(share(&|house| house.rooms.len() == 4), 5.0 / 22.0));
    assert!(houses.iter().all(|house| house.walls.iter().all(|wall| wall.height_m >= 2.5)));
    let is_painted = |house: &House| house.ceiling.material == "PureWhite";
    assert!(near(share(&is_painted), 0.5));
    let several = |house: &&House| house.rooms.len() > 2;
    let same_floors = |house: &House| {
        house.rooms.iter().all(|room| room.floor_material == house.rooms[0].floor_material)
    };
    let with_several: Vec<&House> = houses.iter().filter(several).collect();
    let same = with_several.iter().filter(|house| same_floors(house)).count();
    assert!(near(same as f64 / with_several.len() as f64, 0.15));
}
