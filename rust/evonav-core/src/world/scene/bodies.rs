//! Bodies of a house in the world frame.

use std::collections::HashMap;

use crate::{
    assets::{
        Asset, Catalogue, UnknownAssets,
        material::{Finish, Material},
        part::{Part, aabb_of},
        shapes::{Shape, lit, shape_of, trimmed_shape},
    },
    error::Error,
    geometry::{Aabb, IDENTITY, Mat3, Vec3, euler_rotation_deg},
    house::{House, Object, Opening, Room, Wall},
    world::scene::{
        openings::{door_shape, is_glazed, window_parts},
        resting::fall_m,
        structure::{Openings, SLAB_M, room_height_m, slab_parts, wall_parts},
    },
};

/// Colour of floors whose material is unknown; the next two are for walls and ceilings.
const FLOOR: [u8; 3] = [170, 150, 125];
const WALL: [u8; 3] = [222, 215, 200];
const CEILING: [u8; 3] = [238, 236, 230];

/// The kind of a body.
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

/// A box with any orientation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OrientedBox {
    /// Centre.
    pub centre_m: Vec3,
    /// Half edge lengths along its own axes.
    pub half_m: Vec3,
    /// Orientation: `world = rotation * own`.
    pub rotation: Mat3,
}

impl OrientedBox {
    /// Convert an axis-aligned box; [`Aabb::EMPTY`] becomes a box of size zero at the origin.
    pub fn of_aabb(aabb: &Aabb) -> Self {
        if *aabb == Aabb::EMPTY {
            return Self { centre_m: [0.0; 3], half_m: [0.0; 3], rotation: IDENTITY };
        }
        let half_m = aabb.size_m().map(|edge| 0.5 * edge);
        Self { centre_m: aabb.centre_m(), half_m, rotation: IDENTITY }
    }
}

/// An object or a part of the building. Its instance id in images is its index in [`Scene::bodies`]
/// plus 1.
#[derive(Debug, Clone, PartialEq)]
pub struct Body {
    /// Id of the object, wall, room, door or window in the house file.
    pub id: String,
    /// Asset category for objects, doors (`Doorway`, `Doorframe`) and windows (`Window`); `Wall`,
    /// `Floor` or `Ceiling` otherwise.
    pub category: String,
    /// Kind of the body.
    pub kind: BodyKind,
    /// Convex parts, world frame; none for open-plan walls.
    pub parts: Vec<Part>,
    /// Parts that only colours show, world frame: see [`Shape::trim`].
    pub trim: Vec<Part>,
    /// Box around the parts; [`Aabb::EMPTY`] if there are none.
    pub aabb: Aabb,
    /// Box around the parts as they are drawn by default, so that an object's measured size does
    /// not change when it is opened.
    pub unopened: Aabb,
    /// The asset's box as it is placed for objects (children rest on their parent, which may be
    /// lower than in the file); `aabb` for all others.
    pub oriented: OrientedBox,
}

impl Body {
    fn fixed(id: &str, category: &str, kind: BodyKind, parts: Vec<Part>) -> Self {
        let aabb = aabb_of(&parts);
        let oriented = OrientedBox::of_aabb(&aabb);
        let (id, category) = (id.to_owned(), category.to_owned());
        Self { id, category, kind, parts, trim: Vec::new(), aabb, unopened: aabb, oriented }
    }

    /// Build the body of an object. `parent` is the object that it stands on, if any, and whether
    /// that one's asset is known.
    fn object(object: &Object, asset: &Asset, parent: Option<(&Self, bool)>) -> Self {
        let rotation = euler_rotation_deg(object.rotation_deg);
        let shape = trimmed_shape(asset, object.condition());
        let Shape { mut parts, mut trim } = shape.placed(object.position_m, &rotation);
        let mut centre_m = object.position_m;
        let mut aabb = aabb_of(&parts);
        if let Some((parent, is_known)) = parent.filter(|_| !object.is_kinematic) {
            let fall_m = fall_m(&parent.parts, &aabb, is_known);
            for part in parts.iter_mut().chain(&mut trim) {
                part.centre_m[1] -= fall_m;
            }
            centre_m[1] -= fall_m;
            aabb = aabb_of(&parts);
        }
        let unopened = match object.condition().openness {
            None => aabb,
            Some(_) => {
                let parts = shape_of(asset);
                aabb_of(
                    &parts.iter().map(|part| part.placed(centre_m, &rotation)).collect::<Vec<_>>(),
                )
            }
        };
        Self {
            id: object.id.clone(),
            category: asset.category.clone(),
            kind: BodyKind::Object,
            parts,
            trim,
            aabb,
            unopened,
            oriented: OrientedBox {
                centre_m,
                half_m: asset.size_m.map(|edge| 0.5 * edge),
                rotation,
            },
        }
    }
}

/// All bodies of a house.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// The structure first (rooms' floors and ceilings, walls, doors, windows), then the objects in
    /// [`crate::house::House::objects`] order.
    pub bodies: Vec<Body>,
    /// Index in `bodies` of the first object.
    pub first_object: usize,
    /// Box around the structure.
    pub bounds: Aabb,
}

impl Scene {
    /// Build the bodies of a house.
    ///
    /// # Arguments
    /// * `house` - positions of all objects and of the structure.
    /// * `catalogue` - facts about the assets.
    /// * `unknown` - treatment of assets that the catalogue does not contain.
    ///
    /// # Errors
    /// [`Error::House`] naming the object whose asset is unknown, unless `unknown` allows it.
    pub fn build(
        house: &House,
        catalogue: &Catalogue,
        unknown: UnknownAssets,
    ) -> Result<Self, Error> {
        let mut scene = Self::build_empty(house, catalogue);
        for object in &house.objects {
            let before = &scene.bodies[scene.first_object..];
            let body = placed(house, object, catalogue, unknown, before)?;
            scene.bodies.push(body);
        }
        Ok(scene)
    }

    /// Build the house without its objects.
    pub fn build_empty(house: &House, catalogue: &Catalogue) -> Self {
        let bodies = structure(house, catalogue);
        let bounds = bodies.iter().fold(Aabb::EMPTY, |bounds, body| bounds.union(body.aabb));
        Self { first_object: bodies.len(), bodies, bounds }
    }

    /// Build this scene after some objects moved; the result is equal to [`Scene::build`] of the
    /// new house.
    ///
    /// # Arguments
    /// * `house` - the house after the move; its structure must be this scene's.
    /// * `catalogue`, `unknown` - the same with which the scene was built.
    /// * `moved` - indices in `house.objects` of all objects whose pose or parent changed. Objects
    ///   that stand on them and objects that this scene does not contain are built again too.
    ///
    /// # Errors
    /// Those of [`Scene::build`].
    pub fn rebuild(
        &self,
        house: &House,
        catalogue: &Catalogue,
        unknown: UnknownAssets,
        moved: &[usize],
    ) -> Result<Self, Error> {
        let (fixed, objects) = self.bodies.split_at(self.first_object.min(self.bodies.len()));
        let known: HashMap<&str, &Body> = objects.iter().map(|b| (b.id.as_str(), b)).collect();
        let mut is_moved = vec![false; house.objects.len()];
        for &index in moved {
            if let Some(flag) = is_moved.get_mut(index) {
                *flag = true;
            }
        }
        let mut bodies = Vec::with_capacity(fixed.len() + house.objects.len());
        bodies.extend_from_slice(fixed);
        for (index, object) in house.objects.iter().enumerate() {
            // Parents come before their children.
            is_moved[index] |=
                object.parent.is_some_and(|parent| parent < index && is_moved[parent]);
            let old = known.get(object.id.as_str()).filter(|_| !is_moved[index]);
            let body = match old {
                Some(&body) => body.clone(),
                None => placed(house, object, catalogue, unknown, &bodies[fixed.len()..])?,
            };
            bodies.push(body);
        }
        Ok(Self { bodies, ..*self })
    }
}

/// Build the body of an object, given the bodies of the objects before it, among them its parent.
fn placed(
    house: &House,
    object: &Object,
    catalogue: &Catalogue,
    unknown: UnknownAssets,
    before: &[Body],
) -> Result<Body, Error> {
    let asset = catalogue.asset_of(house, object, unknown)?;
    let parent = object.parent.and_then(|index| {
        let is_known = catalogue.knows_size(house, &house.objects.get(index)?.asset_id);
        Some((before.get(index)?, is_known))
    });
    Ok(Body::object(object, &asset, parent))
}

/// Build the floors, ceilings, walls, doors and windows.
fn structure(house: &House, catalogue: &Catalogue) -> Vec<Body> {
    let openings = Openings::of(house);
    let paint = |material: &str, tint: Option<[f64; 3]>, otherwise: [u8; 3]| Finish {
        colour: lit(match tint {
            Some(rgb) => rgb.map(|channel| (channel.clamp(0.0, 1.0) * 255.0).round() as u8),
            None => catalogue.material_colour(material).unwrap_or(otherwise),
        }),
        material: Material::of_name(material),
    };
    let floor = |room: &Room| {
        let finish = paint(&room.floor_material, None, FLOOR);
        let parts = slab_parts(&room.polygon_m, [-SLAB_M, 0.0], finish);
        Body::fixed(&room.id, "Floor", BodyKind::Floor, parts)
    };
    let ceiling = |room: &Room| {
        let height_m = room_height_m(house, room);
        let finish = paint(&house.ceiling.material, house.ceiling.colour, CEILING);
        let parts = slab_parts(&room.polygon_m, [height_m, height_m + SLAB_M], finish);
        Body::fixed(&room.id, "Ceiling", BodyKind::Ceiling, parts)
    };
    let wall = |wall: &Wall| {
        let finish = paint(&wall.material, wall.colour, WALL);
        Body::fixed(&wall.id, "Wall", BodyKind::Wall, wall_parts(house, wall, &openings, finish))
    };
    let door = |door: &Opening| {
        let has_leaf = !door.asset_id.starts_with("Doorframe");
        let category = if has_leaf { "Doorway" } else { "Doorframe" };
        let asset = catalogue.get(&door.asset_id);
        let is_glazed = asset.is_some_and(is_glazed);
        let Shape { parts, trim } = door_shape(house, door, asset, is_glazed);
        Body { trim, ..Body::fixed(&door.id, category, BodyKind::Door, parts) }
    };
    let window = |window: &Opening| {
        let parts = window_parts(house, window, catalogue.get(&window.asset_id));
        Body::fixed(&window.id, "Window", BodyKind::Window, parts)
    };
    let rooms = house.rooms.iter().map(floor).chain(house.rooms.iter().map(ceiling));
    let walls = house.walls.iter().map(wall);
    let fillings = house.doors.iter().map(door).chain(house.windows.iter().map(window));
    rooms.chain(walls).chain(fillings).collect()
}
