//! Build the typed view of a house document. Both schemas are read: 0.0.1 (openings with
//! `boundingBox`, materials as strings) and 1.0.0 (`holePolygon`, materials as objects).

use std::collections::HashMap;

use serde_json::Value;

use crate::{
    Error,
    geometry::Vec2,
    house::{
        EXTERIOR, House, Object, Opening, OwnAsset, Room, Start, Surface, Wall,
        node::{MAX_COORDINATE_M, Node},
    },
};

/// Largest numbers of rooms, walls (both sides), openings and objects of one house: about 20 times
/// those of the largest recorded house.
const MAX_ROOMS: usize = 256;
const MAX_WALLS: usize = 4096;
const MAX_OPENINGS: usize = 2048;
const MAX_OBJECTS: usize = 8192;
const MAX_CORNERS: usize = 256;
const MIN_HEIGHT_M: f64 = 0.1;
const MAX_HEIGHT_M: f64 = 30.0;
const MAX_FOOT_M: f64 = 0.01;
/// Largest Euler angle; recorded ones are within two turns of zero.
const MAX_ANGLE_DEG: f64 = 3600.0;
/// Smallest and largest edge of an asset whose size the document gives.
const ASSET_EDGE_M: [f64; 2] = [0.001, 30.0];
const SCHEMAS: [&str; 2] = ["0.0.1", "1.0.0"];

/// Build the view. Each field is checked here on its own; [`super::validate`] checks whether the
/// fields agree.
pub(super) fn view(name: &str, document: Value) -> Result<House, Error> {
    let root = Node::root(name, &document);
    let metadata = root.get("metadata")?;
    if let Some(schema) = metadata.maybe("schema")?
        && !SCHEMAS.contains(&schema.text()?)
    {
        return Err(schema.expected("schema 0.0.1 or 1.0.0"));
    }
    let start = metadata.maybe("agent")?.map(|agent| start(&agent)).transpose()?;
    let own_assets =
        metadata.maybe("evonav_assets")?.map(|sizes| own_assets(&sizes)).transpose()?;
    let parameters = root.maybe("proceduralParameters")?;
    let ceiling = parameters.as_ref().map_or_else(|| Ok(Surface::default()), ceiling)?;
    let rooms: Vec<Room> =
        root.get("rooms")?.list(MAX_ROOMS)?.map(|node| room(&node)).collect::<Result<_, _>>()?;
    let walls: Vec<Wall> =
        root.get("walls")?.list(MAX_WALLS)?.map(|node| wall(&node)).collect::<Result<_, _>>()?;
    let doors = openings(&root.get("doors")?)?;
    let windows = openings(&root.get("windows")?)?;
    let mut objects = Vec::new();
    object_list(&root.get("objects")?, None, &mut objects)?;
    let index =
        objects.iter().enumerate().map(|(i, o): (usize, &Object)| (o.id.clone(), i)).collect();
    let mut house = House {
        name: name.to_owned(),
        rooms,
        walls,
        doors,
        windows,
        objects,
        ceiling,
        start,
        own_assets: own_assets.unwrap_or_default(),
        index,
        document: Value::Null,
    };
    assign_rooms(&mut house);
    house.document = document;
    Ok(house)
}

fn start(agent: &Node<'_>) -> Result<Start, Error> {
    let horizon_deg = agent.maybe("horizon")?.map_or(Ok(0.0), |node| node.number(-90.0, 90.0))?;
    Ok(Start {
        position_m: agent.get("position")?.point()?,
        yaw_deg: agent.get("rotation")?.vector(MAX_ANGLE_DEG)?[1],
        horizon_deg,
    })
}

fn own_assets(sizes: &Node<'_>) -> Result<HashMap<String, OwnAsset>, Error> {
    sizes.entries(MAX_OBJECTS)?.map(|(id, node)| Ok((id.to_owned(), own_asset(&node)?))).collect()
}

fn own_asset(node: &Node<'_>) -> Result<OwnAsset, Error> {
    let size = node.get("size_m")?;
    let [low, high] = ASSET_EDGE_M;
    let edges = size.list(3)?.map(|edge| edge.number(low, high)).collect::<Result<Vec<_>, _>>()?;
    let [x, y, z] = edges[..] else {
        return Err(size.expected("three edge lengths, [x, y, z]"));
    };
    let flag = |key| node.maybe(key)?.map_or(Ok(false), |flag| flag.boolean());
    Ok(OwnAsset {
        category: node.get("category")?.name()?.to_owned(),
        size_m: [x, y, z],
        is_pickupable: flag("pickupable")?,
        is_moveable: flag("moveable")?,
        is_receptacle: flag("receptacle")?,
        is_openable: flag("openable")?,
    })
}

/// Read a material: `"Name"` or `{name, color}`. A separate colour key beside it takes precedence.
fn surface(holder: &Node<'_>, material_key: &str, colour_key: &str) -> Result<Surface, Error> {
    let mut found = Surface::default();
    if let Some(material) = holder.maybe(material_key)? {
        if let Ok(name) = material.text() {
            found.material = name.to_owned();
        } else {
            found.material = material.get("name")?.text()?.to_owned();
            found.colour = material.maybe("color")?.map(|node| node.colour()).transpose()?;
        }
    }
    if let Some(colour) = holder.maybe(colour_key)? {
        found.colour = Some(colour.colour()?);
    }
    Ok(found)
}

fn ceiling(parameters: &Node<'_>) -> Result<Surface, Error> {
    surface(parameters, "ceilingMaterial", "ceilingColor")
}

fn room(node: &Node<'_>) -> Result<Room, Error> {
    let id = node.get("id")?.name()?.to_owned();
    let polygon = node.get("floorPolygon")?;
    let corners = polygon.list(MAX_CORNERS)?.map(|corner| Ok(flat(corner.point()?)));
    Ok(Room {
        id,
        room_type: node.get("roomType")?.name()?.to_owned(),
        polygon_m: corners.collect::<Result<_, Error>>()?,
        floor_material: surface(node, "floorMaterial", "floorColor")?.material,
    })
}

fn flat(point_m: [f64; 3]) -> Vec2 {
    [point_m[0], point_m[2]]
}

fn wall(node: &Node<'_>) -> Result<Wall, Error> {
    let id = node.get("id")?.name()?.to_owned();
    let polygon = node.get("polygon")?;
    let corners = polygon.list(4)?.map(|corner| corner.point()).collect::<Result<Vec<_>, _>>()?;
    let [a, b, c, d] = corners[..] else {
        return Err(polygon.error(format!("has {} corners, expected 4", corners.len())));
    };
    // ProcTHOR lists inner sides foot first and outer sides top first, both pairs in the same
    // order; other tools list the corners in a circle.
    let ([from, to], mut top) = if a[1] <= c[1] { ([a, b], [c, d]) } else { ([c, d], [a, b]) };
    if flat(top[0]) == flat(to) {
        top.reverse();
    }
    let is_upright = flat(top[0]) == flat(from) && flat(top[1]) == flat(to);
    if !is_upright || from[1] != to[1] || top[0][1] != top[1][1] {
        return Err(polygon.expected("an upright rectangle: two foot corners and two top corners"));
    }
    if from[1].abs() > MAX_FOOT_M {
        return Err(polygon.error(format!("foot is at a height of {} m, expected 0", from[1])));
    }
    let height_m = top[0][1] - from[1];
    if !(MIN_HEIGHT_M..=MAX_HEIGHT_M).contains(&height_m) {
        let expected = format!("expected {MIN_HEIGHT_M} to {MAX_HEIGHT_M}");
        return Err(polygon.error(format!("wall is {height_m} m high, {expected}")));
    }
    let Surface { material, colour } = surface(node, "material", "color")?;
    // Outer sides name the room that they enclose; only their id distinguishes them.
    let room_id = node.get("roomId")?.name()?;
    let is_outer = id.starts_with("wall|exterior");
    Ok(Wall {
        id,
        room_id: if is_outer { EXTERIOR } else { room_id }.to_owned(),
        from_m: flat(from),
        to_m: flat(to),
        height_m,
        is_empty: node.maybe("empty")?.map_or(Ok(false), |empty| empty.boolean())?,
        material,
        colour,
    })
}

fn openings(list: &Node<'_>) -> Result<Vec<Opening>, Error> {
    if list.is_null() {
        return Ok(Vec::new()); // generator steps before the doors save null
    }
    list.list(MAX_OPENINGS)?.map(|node| opening(&node)).collect()
}

fn opening(node: &Node<'_>) -> Result<Opening, Error> {
    let owned = |key| -> Result<String, Error> { Ok(node.get(key)?.name()?.to_owned()) };
    let [hole_min_m, hole_max_m] = hole(node)?;
    let asset_id = owned("assetId")?;
    let has_leaf = !asset_id.starts_with("Doorframe");
    let openness = match node.maybe("openness")? {
        Some(openness) => openness.number(0.0, 1.0)?,
        None => f64::from(u8::from(!has_leaf)),
    };
    Ok(Opening {
        id: owned("id")?,
        asset_id,
        wall0: owned("wall0")?,
        wall1: owned("wall1")?,
        room_ids: [owned("room0")?, owned("room1")?],
        hole_min_m,
        hole_max_m,
        openness,
        is_openable: node.maybe("openable")?.map_or(Ok(false), |openable| openable.boolean())?,
    })
}

/// Return `[along, up]` of the hole's smallest and largest corner, in the wall's frame.
fn hole(node: &Node<'_>) -> Result<[Vec2; 2], Error> {
    let along_up = |corner: Node<'_>| corner.point().map(|[x, y, _]| [x, y]);
    let corners = if let Some(polygon) = node.maybe("holePolygon")? {
        polygon.list(MAX_CORNERS)?.map(along_up).collect::<Result<Vec<_>, _>>()?
    } else {
        let bounds = node.get("boundingBox")?;
        vec![along_up(bounds.get("min")?)?, along_up(bounds.get("max")?)?]
    };
    let extreme = |axis: usize, pick: fn(f64, f64) -> f64| {
        corners.iter().map(|corner| corner[axis]).reduce(pick).unwrap_or(0.0)
    };
    let low = [extreme(0, f64::min), extreme(1, f64::min)];
    let high = [extreme(0, f64::max), extreme(1, f64::max)];
    if low[0] < high[0] && low[1] < high[1] {
        return Ok([low, high]);
    }
    Err(node.error(format!("hole from {low:?} to {high:?} has no area")))
}

fn object_list(
    list: &Node<'_>,
    parent: Option<usize>,
    objects: &mut Vec<Object>,
) -> Result<(), Error> {
    for node in list.list(MAX_OBJECTS)? {
        let index = objects.len();
        if index >= MAX_OBJECTS {
            return Err(node.error(format!("more than {MAX_OBJECTS} objects")));
        }
        objects.push(object(&node, parent)?);
        if let Some(parent) = parent {
            objects[parent].children.push(index);
        }
        // The recursion is as deep as serde_json lets a document be (128 levels).
        if let Some(children) = node.maybe("children")? {
            object_list(&children, Some(index), objects)?;
        }
    }
    Ok(())
}

fn object(node: &Node<'_>, parent: Option<usize>) -> Result<Object, Error> {
    let id = node.get("id")?.name()?.to_owned();
    Ok(Object {
        id,
        asset_id: node.get("assetId")?.name()?.to_owned(),
        position_m: node.get("position")?.vector(MAX_COORDINATE_M)?,
        rotation_deg: node.get("rotation")?.vector(MAX_ANGLE_DEG)?,
        parent,
        children: Vec::new(),
        room: None,
        object_type: node
            .maybe("objectType")?
            .map(|it| it.name().map(str::to_owned))
            .transpose()?,
        is_kinematic: node.maybe("kinematic")?.map_or(Ok(false), |it| it.boolean())?,
        openness: node.maybe("openness")?.map(|openness| openness.number(0.0, 1.0)).transpose()?,
        is_on: node.maybe("isOn")?.map(|is_on| is_on.boolean()).transpose()?,
    })
}

/// Assign rooms: an object without a parent is in the room that contains its position, every other
/// one in the room of its parent.
fn assign_rooms(house: &mut House) {
    for index in 0..house.objects.len() {
        let object = &house.objects[index];
        house.objects[index].room = match object.parent {
            Some(parent) => house.objects[parent].room,
            None => house.room_of(flat(object.position_m)),
        };
    }
}
