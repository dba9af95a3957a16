//! Where a task starts when the house's own start is not free.

use evonav_core::{
    generation::{Generation, Parameters, record::RejectReason},
    geometry::Vec2,
    house::House,
};
use serde_json::{Value, json};

use super::tasks::{navigation_in, try_generate};

fn room(number: usize, kind: &str, [x0, z0, x1, z1]: [f64; 4]) -> Value {
    let corners = [[x0, z0], [x0, z1], [x1, z1], [x1, z0]];
    let floor = corners.map(|[x, z]| json!({"x": x, "y": 0, "z": z}));
    let floor_material = json!({"name": "DarkWoodFloors"});
    json!({"id": format!("room|{number}"), "roomType": kind, "floorMaterial": floor_material, "floorPolygon": floor})
}

fn wall(number: usize, a: Vec2, b: Vec2) -> Value {
    let corner = |[x, z]: Vec2, y: f64| json!({"x": x, "y": y, "z": z});
    let polygon = [corner(a, 0.0), corner(b, 0.0), corner(a, 2.5), corner(b, 2.5)];
    json!({"id": format!("wall|{number}"), "roomId": "room|1", "material": {"name": "PureWhite"}, "polygon": polygon})
}

/// Two rooms of 4 x 4 m that are open to each other, and beyond x = 8 a closet without a door.
fn house(start_m: Vec2) -> House {
    let walls: [(Vec2, Vec2); 8] = [
        ([0.0, 0.0], [8.0, 0.0]),
        ([0.0, 4.0], [8.0, 4.0]),
        ([0.0, 0.0], [0.0, 4.0]),
        ([8.0, 0.0], [8.0, 4.0]),
        ([8.0, 1.0], [9.5, 1.0]),
        ([8.0, 3.0], [9.5, 3.0]),
        ([9.5, 1.0], [9.5, 3.0]),
        ([0.0, 0.0], [0.0, 4.0]),
    ];
    let walls: Vec<Value> = walls.iter().enumerate().map(|(i, &(a, b))| wall(i, a, b)).collect();
    let object = |id: &str, asset: &str, position: [f64; 3], yaw_deg: f64| {
        let [x, y, z] = position;
        json!({"id": id, "assetId": asset, "position": {"x": x, "y": y, "z": z},
            "rotation": {"x": 0, "y": yaw_deg, "z": 0}, "children": []})
    };
    let [x, z] = start_m;
    let json = json!({
        "rooms": [
            room(1, "Kitchen", [0.0, 0.0, 4.0, 4.0]),
            room(2, "Bedroom", [4.0, 0.0, 8.0, 4.0]),
            room(3, "Bathroom", [8.0, 1.0, 9.5, 3.0]),
        ],
        "walls": walls, "doors": [], "windows": [], "proceduralParameters": {},
        "objects": [
            object("1|0", "Fridge_11", [0.5, 0.983, 2.0], 90.0),
            object("2|0", "Dresser_205_1", [6.0, 0.349, 3.7], 180.0),
            object("2|1", "Toilet_1", [6.0, 0.519, 0.45], 0.0),
        ],
        "metadata": {"agent": {"position": {"x": x, "y": 0.9, "z": z},
            "rotation": {"x": 0, "y": 0, "z": 0}, "horizon": 30, "standing": true}},
    });
    House::from_json("closet", &json.to_string()).expect("a valid house")
}

fn start_of(house: &House) -> Result<[f64; 3], RejectReason> {
    match try_generate(house, 0, &Parameters::default()) {
        Ok(Generation::Task(task)) => Ok(task.stages[0].start_pose.position_m),
        Ok(Generation::Rejected(rejected)) => Err(rejected.reason),
        Err(error) => panic!("{error}"),
    }
}

#[test]
fn a_start_in_a_wall_goes_where_the_house_is() {
    // Nearer to the closet than to the bedroom.
    let start_m = [8.06, 2.0];
    let house = house(start_m);
    let navigation = navigation_in(&house);
    let nearest_m = navigation.snap(start_m).expect("the closet");
    assert!(nearest_m[0] > 8.0, "{nearest_m:?}");
    let [x, _, z] = start_of(&house).expect("a task");
    assert!(x < 8.0, "{x} {z}");
    assert!(navigation.is_free([x, z]));
    assert!(navigation.is_connected([x, z], [2.0, 2.0]));
    assert!((x - start_m[0]).hypot(z - start_m[1]) <= 0.5);
}

#[test]
fn a_start_that_is_free_stays() {
    assert_eq!(start_of(&house([5.0, 2.0])).map(|[x, _, z]| [x, z]), Ok([5.0, 2.0]));
}

#[test]
fn a_start_that_only_a_pocket_is_near_gives_no_task() {
    // In the closet's far corner: its own room is all that is near.
    assert_eq!(start_of(&house([9.4, 2.0])), Err(RejectReason::Disconnected));
    assert_eq!(start_of(&house([8.75, 2.0])), Err(RejectReason::Disconnected));
}
