//! Bodies of a house in the world frame.

use crate::{assets::part::Part, geometry::Aabb};

/// What a body is to the simulator.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BodyKind {
    /// An object of the house file.
    Object,
    /// A wall, with its openings cut out.
    Wall,
    /// A room's floor.
    Floor,
    /// A room's ceiling.
    Ceiling,
    /// A door's leaf and frame.
    Door,
    /// A window's pane and frame.
    Window,
}

/// A thing in the world; its instance id in images is its index in [`Scene::bodies`] plus 1.
#[derive(Debug, Clone, PartialEq)]
pub struct Body {
    /// Id of the object, wall, room, door or window in the house file.
    pub id: String,
    /// Asset category for objects; `Wall`, `Floor`, `Ceiling`, `Doorway`, `Window` otherwise.
    pub category: String,
    /// Its kind.
    pub kind: BodyKind,
    /// Convex parts, world frame.
    pub parts: Vec<Part>,
    /// Box around the parts.
    pub aabb: Aabb,
}

/// All bodies of a house.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// Structure first (rooms' floors and ceilings, walls, doors, windows), then objects in
    /// [`crate::house::House::objects`] order.
    pub bodies: Vec<Body>,
    /// Index in `bodies` of the first object.
    pub first_object: usize,
    /// Box around the structure.
    pub bounds: Aabb,
}
