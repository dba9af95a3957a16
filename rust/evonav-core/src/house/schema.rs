//! A house: the document as it was read, and a typed view of it.

use std::collections::HashMap;

use crate::{
    Error,
    geometry::{Vec2, Vec3, polygon_contains},
};

/// [`Wall::room_id`] of outer sides.
pub const EXTERIOR: &str = "exterior";

/// A house: the document as it was read, and what evonav understands of it.
///
/// The document is kept whole, in order, with every key that evonav does not know; the view is
/// derived from it and never changed on its own.
#[derive(Debug, Clone, PartialEq)]
pub struct House {
    /// File name or the caller's name, for errors.
    pub name: String,
    /// Rooms, in file order.
    pub rooms: Vec<Room>,
    /// Walls, in file order (each inner wall once a room, outer ones also as `wall|exterior`).
    pub walls: Vec<Wall>,
    /// Doors and doorways, in file order.
    pub doors: Vec<Opening>,
    /// Windows, in file order.
    pub windows: Vec<Opening>,
    /// Objects, in depth-first file order: a parent stands before its children.
    pub objects: Vec<Object>,
    /// Material of the ceilings.
    pub ceiling: Surface,
    /// `metadata.agent`: the house's default start; absent in a few houses.
    pub start: Option<Start>,
    /// [`House::objects`] by id.
    pub(super) index: HashMap<String, usize>,
    /// Lossless source.
    pub(crate) document: serde_json::Value,
}

/// What a floor, wall or ceiling is made of.
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
    /// For example `room|4`.
    pub id: String,
    /// `Kitchen`, `LivingRoom`, `Bedroom`, `Bathroom` ...
    pub room_type: String,
    /// Floor outline `[x, z]`.
    pub polygon_m: Vec<Vec2>,
    /// Name of the floor's material, empty if none is given.
    pub floor_material: String,
}

/// One side of a wall.
#[derive(Debug, Clone, PartialEq)]
pub struct Wall {
    /// For example `wall|4|0.00|1.95|1.95|1.95`.
    pub id: String,
    /// Room it faces; `exterior` for outer sides.
    pub room_id: String,
    /// Foot of the wall, `[x, z]`, origin of the wall's own frame: the first foot corner listed.
    pub from_m: Vec2,
    /// Other end of the foot.
    pub to_m: Vec2,
    /// Height above the floor.
    pub height_m: f64,
    /// Open plan: passable and see-through.
    pub is_empty: bool,
    /// Name of the material, empty if none is given.
    pub material: String,
    /// `color`, 0..1, if given.
    pub colour: Option<[f64; 3]>,
}

/// A door, doorway or window: a hole in one or two walls and what fills it.
#[derive(Debug, Clone, PartialEq)]
pub struct Opening {
    /// For example `door|4|5`.
    pub id: String,
    /// Asset that fills the hole.
    pub asset_id: String,
    /// Wall whose frame the hole is given in.
    pub wall0: String,
    /// The wall's other side.
    pub wall1: String,
    /// Rooms on both sides (equal for windows and outer doors).
    pub room_ids: [String; 2],
    /// Hole in the frame of `wall0`: `[along, up]` of its smallest corner ...
    pub hole_min_m: Vec2,
    /// ... and of its largest.
    pub hole_max_m: Vec2,
    /// 0 closed, 1 open; where the file is silent, 1 for a `Doorframe_*` and 0 otherwise.
    pub openness: f64,
    /// Whether it can open at all (`Doorframe_*` have no leaf).
    pub is_openable: bool,
}

/// An object as the file places it.
#[derive(Debug, Clone, PartialEq)]
pub struct Object {
    /// For example `4|0|0`, `small|4|5`, `window|4|0`.
    pub id: String,
    /// Key of the asset catalogue.
    pub asset_id: String,
    /// Centre of its box.
    pub position_m: Vec3,
    /// Unity Euler angles, degrees.
    pub rotation_deg: Vec3,
    /// Index of the object it stands on or in, in [`House::objects`].
    pub parent: Option<usize>,
    /// Indices of what stands on it.
    pub children: Vec<usize>,
    /// Index of the room whose floor polygon holds its position (its root's, for children), if any.
    pub room: Option<usize>,
    /// `objectType` where the file gives one (Objaverse assets).
    pub object_type: Option<String>,
    /// Fixed by the file.
    pub is_kinematic: bool,
    /// `openness` of the object, if given: 0 closed, 1 open.
    pub openness: Option<f64>,
    /// `isOn` of the object, if given.
    pub is_on: Option<bool>,
}

/// Where the house file puts the agent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Start {
    /// `metadata.agent.position`.
    pub position_m: Vec3,
    /// `metadata.agent.rotation.y`, degrees.
    pub yaw_deg: f64,
    /// `metadata.agent.horizon`, degrees.
    pub horizon_deg: f64,
}

/// What is known of a thing's state.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Condition {
    /// 0 closed, 1 open; `None` where the file is silent.
    pub openness: Option<f64>,
    /// Whether a lamp or screen is lit; `None` where the file is silent.
    pub is_on: Option<bool>,
}

impl Object {
    /// What the file says of its state.
    pub fn condition(&self) -> Condition {
        Condition { openness: self.openness, is_on: self.is_on }
    }
}

impl House {
    /// The document: every key and value as it was read, in order; compact.
    pub fn to_json(&self) -> String {
        self.document.to_string()
    }

    /// Index of the first room whose floor holds `point_m`.
    pub fn room_of(&self, point_m: Vec2) -> Option<usize> {
        self.rooms.iter().position(|room| polygon_contains(&room.polygon_m, point_m))
    }

    /// Index in [`House::objects`].
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
