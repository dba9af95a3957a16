//! Reading, refusing and writing houses.

use evonav_core::{Error, house::House};
use serde_json::{Value, json};

const SMALL: &str = include_str!("../data/house_39_objects.json");
const LARGE: &str = include_str!("../data/house_100_objects.json");

/// The document with the value at `pointer` replaced.
fn changed(pointer: &str, value: Value) -> String {
    let mut document: Value = serde_json::from_str(SMALL).expect("valid JSON");
    *document.pointer_mut(pointer).expect("a place in the house") = value;
    document.to_string()
}

/// Object, field and message of the refusal.
fn refusal(json: &str) -> (String, String, String) {
    match House::from_json("h.json:3", json) {
        Err(Error::House { house, object, field, message }) => {
            assert_eq!(house, "h.json:3");
            (object, field, message)
        }
        other => panic!("expected Error::House, got {other:?}"),
    }
}

#[test]
fn view_holds_what_the_file_says() {
    let house = House::from_json("small", SMALL).expect("a valid house");
    assert_eq!((house.rooms.len(), house.objects.len()), (4, 39));
    for (index, object) in house.objects.iter().enumerate() {
        assert_eq!(house.object_index(&object.id), Some(index));
        assert!(object.parent.is_none_or(|parent| parent < index));
        assert!(object.children.iter().all(|&child| house.objects[child].parent == Some(index)));
        assert_eq!(
            object.room.is_some(),
            object.parent.is_some_and(|p| house.objects[p].room.is_some())
                || house.room_of([object.position_m[0], object.position_m[2]]).is_some()
                    && object.parent.is_none()
        );
    }
    assert_eq!(house.object_index("no such object"), None);
    assert!(house.walls.iter().any(|wall| wall.room_id == evonav_core::house::EXTERIOR));
    assert!(house.doors.iter().all(|door| door.hole_max_m[0] > door.hole_min_m[0]));
    assert!(house.start.is_some());
    assert!(!house.ceiling.material.is_empty());
}

#[test]
fn document_survives_byte_for_byte() {
    // Written by Python with spaces after separators; values and key order are what must stay.
    for json in [SMALL, LARGE] {
        let house = House::from_json("house", json).expect("a valid house");
        let again: Value = serde_json::from_str(&house.to_json()).expect("valid JSON");
        let source: Value = serde_json::from_str(json).expect("valid JSON");
        assert_eq!(again.to_string(), source.to_string());
        assert_eq!(House::from_json("house", &house.to_json()).expect("valid"), house);
    }
}

/// `{x, y, z}` of `[x, z]` points on the floor.
fn corners(points: &[[i32; 2]]) -> Value {
    points.iter().map(|[x, z]| json!({"x": x, "y": 0, "z": z})).collect()
}

/// A side of a room that is rounded and ends at several walls of others does not cross itself.
#[test]
fn edges_on_one_line_do_not_cross() {
    let side = [2.029, 4.059, 10.147, 12.177].map(|z| json!({"x": 6.088, "y": 0.0, "z": z}));
    let other = [12.177, 2.029].map(|z| json!({"x": 8.118, "y": 0.0, "z": z}));
    let polygon: Vec<Value> = side.into_iter().chain(other).collect();
    let house = changed("/rooms/0/floorPolygon", json!(polygon));
    House::from_json("house", &house).expect("valid");
}

#[test]
fn refusals_name_object_field_and_value() {
    let cases = [
        ("/objects/0/position/x", json!("NaN"), ".position.x", "\"NaN\""),
        ("/objects/0/position/x", json!(1e6), ".position.x", "1000000"),
        ("/objects/0/rotation", json!([0, 90, 0]), ".rotation", "[0,90,0]"),
        ("/objects/0/assetId", json!(7), ".assetId", "7"),
        ("/rooms/0/floorPolygon", json!([]), ".floorPolygon", "0 corners"),
        ("/rooms/0/floorPolygon", corners(&[[0, 0], [4, 0], [8, 0]]), ".floorPolygon", "area of 0"),
        (
            "/rooms/0/floorPolygon",
            corners(&[[0, 0], [4, 4], [4, 0], [0, 5]]),
            ".floorPolygon",
            "cross",
        ),
        ("/walls/0/polygon", corners(&[[0, 0], [4, 0], [4, 0], [0, 0]]), ".polygon", "0 m high"),
        ("/walls/0/roomId", json!("room|99"), ".roomId", "room|99"),
        ("/doors/0/wall0", json!("wall|x"), ".wall0", "wall|x"),
        ("/doors/0/boundingBox/max/x", json!(50.0), ".holePolygon", "50"),
        ("/objects", json!({}), "house.objects", "{}"),
        ("/metadata/schema", json!("2.0.0"), "house.metadata.schema", "2.0.0"),
        ("/metadata/agent/rotation", Value::Null, "house.metadata.agent.rotation", "null"),
    ];
    for (pointer, value, place, found) in cases {
        let (object, field, message) = refusal(&changed(pointer, value));
        assert!(format!("{object}.{field}").ends_with(place), "{pointer}: {object} {field}");
        assert!(message.contains(found), "{pointer}: {message}");
        if let Some(list) = pointer.strip_prefix("/objects/") {
            assert!(list.starts_with("0/") && SMALL.contains(&format!("{object:?}")), "{object}");
        }
    }
    let same_id = changed("/objects/1/id", json!("room|4"));
    assert_eq!(refusal(&same_id).0, "room|4");
    assert_eq!(refusal(&changed("/objects/3", json!([]))).0, "objects[3]");
    let twice = SMALL.replacen("\"roomType\"", "\"id\": \"a\", \"roomType\"", 1);
    assert!(refusal(&twice).2.contains("\"id\" is given twice"));
    assert_eq!(refusal(&"[".repeat(100_000)).0, "document");
}
