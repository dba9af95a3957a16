//! A house: the document as it was read, and a typed view of it.

use std::collections::HashMap;

use crate::{
    Error,
    geometry::{Vec2, Vec3, polygon_contains},
};

/// Value of [`Wall::room_id`] of outer sides.
pub const EXTERIOR: &str = "exterior";

/// A house: the document as it was read, and a typed view of it.
///
/// The document keeps its order and every key, also those that evonav does not know. The view is
/// derived from it and never changed on its own.
#[derive(Debug, Clone, PartialEq)]
pub struct House {
    /// Name of the house in errors: the file name, or the caller's name.
    pub name: String,
    /// Rooms, in file order.
    pub rooms: Vec<Room>,
    /// Walls, in file order: each inner wall once per room, outer ones also as `wall|exterior`.
    pub walls: Vec<Wall>,
    /// Doors and doorways, in file order.
    pub doors: Vec<Opening>,
    /// Windows, in file order.
    pub windows: Vec<Opening>,
    /// Objects, in depth-first file order: a parent comes before its children.
    pub objects: Vec<Object>,
    /// Material of the ceilings.
    pub ceiling: Surface,
    /// The house's default start (`metadata.agent`); absent in a few houses.
    pub start: Option<Start>,
    /// Facts about assets by id that the document itself gives (`metadata.evonav_assets`).
    pub own_assets: HashMap<String, OwnAsset>,
    /// Indices in [`House::objects`] by id.
    pub(super) index: HashMap<String, usize>,
    /// The document as it was read.
    pub(crate) document: serde_json::Value,
}

/// Material and tint of a floor, wall or ceiling.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Surface {
    /// Name of the material, empty if none is given.
    pub material: String,
    /// Tint, 0..1, if given.
    pub colour: Option<[f64; 3]>,
}

/// A room.
#[derive(Debug, Clone, PartialEq)]
pub struct Room {
    /// Id, for example `room|4`.
    pub id: String,
    /// Room type: `Kitchen`, `LivingRoom`, `Bedroom`, `Bathroom` ...
    pub room_type: String,
    /// Floor outline `[x, z]`.
    pub polygon_m: Vec<Vec2>,
    /// Name of the floor's material, empty if none is given.
    pub floor_material: String,
}

/// One side of a wall.
#[derive(Debug, Clone, PartialEq)]
pub struct Wall {
    /// Id, for example `wall|4|0.00|1.95|1.95|1.95`.
    pub id: String,
    /// Room it faces; `exterior` for outer sides.
    pub room_id: String,
    /// Start of the wall's foot, `[x, z]`: the first foot corner listed, and the origin of the
    /// wall's own frame.
    pub from_m: Vec2,
    /// Other end of the foot.
    pub to_m: Vec2,
    /// Height above the floor.
    pub height_m: f64,
    /// Whether the border is open plan: passable and see-through.
    pub is_empty: bool,
    /// Name of the material, empty if none is given.
    pub material: String,
    /// Colour (`color`), 0..1, if given.
    pub colour: Option<[f64; 3]>,
}

/// A door, doorway or window: a hole in one or two walls, and the asset in it.
#[derive(Debug, Clone, PartialEq)]
pub struct Opening {
    /// Id, for example `door|4|5`.
    pub id: String,
    /// Key of the asset that fills the hole.
    pub asset_id: String,
    /// Id of the wall in whose frame the hole is given.
    pub wall0: String,
    /// Id of the wall's other side.
    pub wall1: String,
    /// Ids of the rooms on both sides; equal for windows and outer doors.
    pub room_ids: [String; 2],
    /// Smallest corner of the hole in the frame of `wall0`, `[along, up]`.
    pub hole_min_m: Vec2,
    /// Largest corner of the hole in the frame of `wall0`, `[along, up]`.
    pub hole_max_m: Vec2,
    /// Openness: 0 closed, 1 open. If the file does not give it, 1 for a `Doorframe_*` and 0
    /// otherwise.
    pub openness: f64,
    /// Whether the opening can open at all; a `Doorframe_*` has no leaf.
    pub is_openable: bool,
}

/// An object as the file places it.
#[derive(Debug, Clone, PartialEq)]
pub struct Object {
    /// Id, for example `4|0|0`, `small|4|5`, `window|4|0`.
    pub id: String,
    /// Key of the asset catalogue.
    pub asset_id: String,
    /// Centre of its box.
    pub position_m: Vec3,
    /// Unity Euler angles, degrees.
    pub rotation_deg: Vec3,
    /// Index in [`House::objects`] of the object that it stands on or in.
    pub parent: Option<usize>,
    /// Indices of the objects that stand on it.
    pub children: Vec<usize>,
    /// Index of the room whose floor polygon holds its position (its root's, for children), if any.
    pub room: Option<usize>,
    /// `objectType` where the file gives one (Objaverse assets).
    pub object_type: Option<String>,
    /// Whether the file fixes it in place.
    pub is_kinematic: bool,
    /// `openness` of the object, if given: 0 closed, 1 open.
    pub openness: Option<f64>,
    /// `isOn` of the object, if given.
    pub is_on: Option<bool>,
}

/// Facts about an asset that the catalogue lacks, as a house document gives them.
#[derive(Debug, Clone, PartialEq)]
pub struct OwnAsset {
    /// Object type, for example `DiningTable`.
    pub category: String,
    /// Size of the asset's box at zero yaw, `[x, y, z]`.
    pub size_m: Vec3,
    /// Whether a robot can carry it.
    pub is_pickupable: bool,
    /// Whether it can be pushed.
    pub is_moveable: bool,
    /// Whether it can hold other objects, on its top.
    pub is_receptacle: bool,
    /// Whether it has doors, drawers or a lid.
    pub is_openable: bool,
}

/// The agent's start as the house file gives it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Start {
    /// `metadata.agent.position`.
    pub position_m: Vec3,
    /// `metadata.agent.rotation.y`, degrees.
    pub yaw_deg: f64,
    /// `metadata.agent.horizon`, degrees.
    pub horizon_deg: f64,
}

/// The known state of an object.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Condition {
    /// Openness: 0 closed, 1 open; `None` if the file does not give it.
    pub openness: Option<f64>,
    /// Whether a lamp or screen is lit; `None` if the file does not give it.
    pub is_on: Option<bool>,
}

impl Object {
    /// Return the state that the file gives.
    pub fn condition(&self) -> Condition {
        Condition { openness: self.openness, is_on: self.is_on }
    }
}

impl House {
    /// Write the document compactly: every key and value as it was read, in order.
    pub fn to_json(&self) -> String {
        self.document.to_string()
    }

    /// Return the index of the first room whose floor contains `point_m`.
    pub fn room_of(&self, point_m: Vec2) -> Option<usize> {
        self.rooms.iter().position(|room| polygon_contains(&room.polygon_m, point_m))
    }

    /// Return the id of the first room whose floor contains `point_m`.
    pub fn room_id_of(&self, point_m: Vec2) -> Option<&str> {
        Some(self.rooms[self.room_of(point_m)?].id.as_str())
    }

    /// Return the index in [`House::objects`] of the object with an id.
    pub fn object_index(&self, id: &str) -> Option<usize> {
        self.index.get(id).copied()
    }

    pub(super) fn error(&self, object: &str, field: &str, message: &str) -> Error {
        Error::House {
            house: self.name.clone(),
            object: object.to_owned(),
            field: field.to_owned(),
            message: message.to_owned(),
        }
    }
}
