//! The JSON of a house.

use serde_json::{Map, Value, json};

use crate::{
    assets::OpeningSpace,
    geometry::{Vec2, Vec3},
    house_generation::{
        appearance::{HouseLook, SurfaceLook},
        document::{layers::layers, lights::lights},
        doors::{Openings, PlacedDoor},
        hanging::PlacedWindow,
        objects::HouseObject,
        structure::Structure,
    },
    world::layout::rounding::{ROUND_M, round_to, turned_deg},
};

/// Height of the agent's centre in ProcTHOR's files (`agent.AGENT_Y_HEIGHT`).
const AGENT_Y_M: f64 = 0.95;
/// Horizon of the agent (`agent.AGENT_HORIZON`).
const HORIZON_DEG: i32 = 30;

/// Everything that a house's file says, but its objects and its start.
#[derive(Debug)]
pub(in crate::house_generation) struct Draft<'a> {
    pub structure: &'a Structure,
    pub openings: &'a Openings,
    pub look: &'a HouseLook,
    pub windows: &'a [PlacedWindow],
    /// Seed and number of the house, written into its metadata.
    pub origin: (u64, u64),
}

/// A start pose of the agent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::house_generation) struct Agent {
    pub point_m: Vec2,
    pub yaw_deg: f64,
}

impl Draft<'_> {
    /// Write the house.
    pub fn document(&self, objects: &[HouseObject], agent: Option<Agent>) -> Value {
        let layers = layers(self.structure, &self.openings.is_open);
        let layers = layers.as_deref();
        let mut parameters = json!({
            "floorColliderThickness": 1.0,
            "receptacleHeight": 0.7,
            "lights": lights(self.structure, self.look, layers),
            "reflections": [],
            "ceilingMaterial": material(&self.look.ceiling),
        });
        parameters["skyboxId"] = json!(self.look.sky);
        json!({
            "rooms": self.rooms(layers),
            "doors": self.doors(),
            "windows": self.windows(),
            "objects": object_tree(objects, layers),
            "walls": self.walls(layers),
            "proceduralParameters": parameters,
            "metadata": self.metadata(agent),
        })
    }

    fn rooms(&self, layers: Option<&[usize]>) -> Vec<Value> {
        let room = |index: usize| {
            let room = &self.structure.rooms[index];
            let polygon: Vec<Value> =
                room.polygon_m().iter().map(|&[x, z]| vector([x, 0.0, z])).collect();
            let mut value = json!({
                "id": format!("room|{}", room.number),
                "roomType": room.room_type,
                "children": [],
                "ceilings": [],
                "floorPolygon": polygon,
                "floorMaterial": {"name": self.look.floors[index]},
            });
            add_layer(&mut value, layers, index);
            value
        };
        (0..self.structure.rooms.len()).map(room).collect()
    }

    /// Write the inner sides of all walls, then the outer ones.
    fn walls(&self, layers: Option<&[usize]>) -> Vec<Value> {
        let structure = self.structure;
        let (mut inner, mut outer) = (Vec::new(), Vec::new());
        for (index, room) in structure.rooms.iter().enumerate() {
            for side in &room.sides {
                let corners = [side.from_m, side.to_m];
                let at = |height_m: f64| corners.map(|[x, z]| vector([x, height_m, z]));
                let [low, high] = [at(0.0), at(structure.height_m)];
                let polygon = [low, high].concat();
                let room_id = format!("room|{}", room.number);
                let mut wall = json!({
                    "id": structure.wall_id(Some(index), side.border),
                    "roomId": room_id,
                    "polygon": polygon,
                });
                if self.openings.is_open[side.border] {
                    wall["empty"] = json!(true);
                }
                wall["material"] = material(&self.look.walls[index]);
                add_layer(&mut wall, layers, index);
                inner.push(wall);
                if structure.borders[side.border].rooms.1.is_none() {
                    let reversed: Vec<Value> = polygon.into_iter().rev().collect();
                    let mut wall = json!({
                        "id": structure.wall_id(None, side.border),
                        "polygon": reversed,
                        "roomId": room_id,
                        "material": {"name": self.look.outside},
                    });
                    add_layer(&mut wall, layers, index);
                    outer.push(wall);
                }
            }
        }
        inner.extend(outer);
        inner
    }

    fn doors(&self) -> Vec<Value> {
        let structure = self.structure;
        let number = |room: Option<usize>| room.map_or(1, |room| structure.rooms[room].number);
        let door = |door: &PlacedDoor| {
            let (own, other) = (number(Some(door.room)), number(door.other));
            let space = door.space;
            let mut value = json!({
                "id": format!("door|{}|{}", own.min(other), own.max(other)),
                "room0": format!("room|{own}"),
                "room1": format!("room|{}", door.other.map_or(own, |_| other)),
                "wall0": structure.wall_id(Some(door.room), door.border),
                "wall1": structure.wall_id(door.other, door.border),
                "assetId": space.id,
            });
            add_hole(&mut value, space, [door.start_m, 0.0], space.hole_m);
            if !door.is_frame() {
                value["openable"] = json!(door.other.is_some());
                value["openness"] = json!(u8::from(door.other.is_some()));
            }
            value
        };
        self.openings.doors.iter().map(door).collect()
    }

    fn windows(&self) -> Vec<Value> {
        let mut num_of_room = vec![0; self.structure.rooms.len()];
        let mut window = |window: &PlacedWindow| {
            let number = self.structure.rooms[window.room].number;
            let room_id = format!("room|{number}");
            let count = num_of_room[window.room];
            num_of_room[window.room] += 1;
            let mut value = json!({
                "id": format!("window|{number}|{count}"),
                "assetId": window.space.id,
                "room0": room_id,
                "room1": room_id,
                "wall0": self.structure.wall_id(Some(window.room), window.border),
                "wall1": self.structure.wall_id(None, window.border),
            });
            let [x, y, _] = window.asset.size_m;
            add_hole(&mut value, window.space, [window.start_m, window.bottom_m], [x, y]);
            value
        };
        self.windows.iter().map(&mut window).collect()
    }

    fn metadata(&self, agent: Option<Agent>) -> Value {
        let mut metadata = Map::new();
        if let Some(Agent { point_m: [x, z], yaw_deg }) = agent {
            let pose = json!({
                "position": {"x": x, "y": AGENT_Y_M, "z": z},
                "rotation": {"x": 0, "y": yaw_deg, "z": 0},
                "standing": true,
                "horizon": HORIZON_DEG,
            });
            metadata.insert("agent".to_owned(), pose);
        }
        metadata.insert("roomSpecId".to_owned(), json!(self.structure.spec_id));
        metadata.insert("schema".to_owned(), json!("1.0.0"));
        metadata.insert("warnings".to_owned(), json!({}));
        let (seed, index) = self.origin;
        metadata.insert("evonav_houses".to_owned(), json!({"seed": seed, "index": index}));
        Value::Object(metadata)
    }
}

/// Add the hole of an opening and the middle of its asset, in the frame of its wall.
///
/// # Arguments
/// * `start_m` - lower corner of its box, along the wall and upwards.
/// * `size_m` - size of its box.
fn add_hole(value: &mut Value, space: &OpeningSpace, start_m: Vec2, size_m: Vec2) {
    let [dx, dy] = space.offset_m;
    let low = [start_m[0] - dx, start_m[1]];
    let high = [low[0] + space.hole_m[0], low[1] + space.hole_m[1] - dy];
    let middle = [low[0] + 0.5 * size_m[0] + dx, low[1] + 0.5 * size_m[1] + dy];
    let point = |[x, y]: Vec2| vector([x, y, 0.0]);
    value["holePolygon"] = json!([point(low), point(high)]);
    value["assetPosition"] = point(middle);
}

/// Write objects with those that stand on them as `children`.
fn object_tree(objects: &[HouseObject], layers: Option<&[usize]>) -> Vec<Value> {
    let mut values: Vec<Option<Value>> =
        objects.iter().map(|object| Some(object_value(object, layers))).collect();
    for index in (0..objects.len()).rev() {
        if let Some(parent) = objects[index].parent
            && let Some(child) = values[index].take()
            && let Some(Value::Object(fields)) = values[parent].as_mut()
        {
            let children = fields.entry("children").or_insert_with(|| json!([]));
            if let Value::Array(list) = children {
                list.insert(0, child);
            }
        }
    }
    values.into_iter().flatten().collect()
}

fn object_value(object: &HouseObject, layers: Option<&[usize]>) -> Value {
    let mut value = json!({
        "id": object.id,
        "position": vector(object.position_m),
        "rotation": vector(object.rotation_deg.map(turned_deg)),
        "assetId": object.asset.id,
        "kinematic": object.is_kinematic(),
    });
    let states = [("isOn", object.is_on), ("isDirty", object.is_dirty)];
    for (key, state) in states.into_iter().filter_map(|(key, state)| Some((key, state?))) {
        value[key] = json!(state);
    }
    if let Some(openness) = object.openness {
        value["openness"] = json!(round_to(openness, ROUND_M));
    }
    add_layer(&mut value, layers, object.room);
    value
}

fn material(look: &SurfaceLook) -> Value {
    match look.paint {
        Some(paint) => {
            let [r, g, b] = paint.map(|channel| f64::from(channel) / 255.0);
            json!({"name": look.material, "color": {"r": r, "g": g, "b": b}})
        }
        None => json!({"name": look.material}),
    }
}

fn add_layer(value: &mut Value, layers: Option<&[usize]>, room: usize) {
    if let Some(layer) = layers.and_then(|layers| layers.get(room)) {
        value["layer"] = json!(format!("Procedural{layer}"));
    }
}

/// Write a vector, rounded as all positions are.
fn vector(vector: Vec3) -> Value {
    let [x, y, z] = vector.map(|value| round_to(value, ROUND_M));
    json!({"x": x, "y": y, "z": z})
}
