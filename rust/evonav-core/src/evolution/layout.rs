//! Objects of a house as they are moved about: poses, plan outlines, collision.

use super::plan::overlap_m;
use crate::{
    Error,
    assets::{
        Asset,
        catalogue::{Catalogue, UnknownAssets},
        part::Part,
        placement::Place,
        shapes::shape_in,
    },
    geometry::{Aabb, Vec2, Vec3, distance_2d_m, euler_rotation_deg},
    house::{House, HouseDelta, ObjectMove, Opening},
    world::{
        footprint::{Footprint, footprint},
        scene::{BodyKind, Scene},
    },
};

/// Overlap in plan or height that counts as touching: recorded houses have as much.
pub const TOUCH_M: f64 = 0.002;
/// Gap that furniture keeps to furniture.
const FURNITURE_GAP_M: f64 = 0.02;
/// Depth of the floor on either side of a door that furniture is not put on.
const DOORWAY_M: f64 = 0.5;
/// A root whose bottom is lower stands on the floor.
const FLOOR_M: f64 = 0.05;

/// Where an object is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    /// Centre of its box.
    pub position_m: Vec3,
    /// Unity Euler angles.
    pub rotation_deg: Vec3,
    /// Index of what it stands on or in.
    pub parent: Option<usize>,
}

/// One object of the house.
#[derive(Debug, Clone)]
pub struct Item {
    /// Its asset.
    pub asset: Asset,
    /// Its shape, object frame.
    parts: Vec<Part>,
    /// Where it is now.
    pub placement: Placement,
    /// Plan outlines of its parts, with their heights.
    pub solids: Vec<Footprint>,
    /// Stands on the floor by itself: furniture, and boxes and balls on the floor.
    pub is_on_floor: bool,
}

impl Item {
    /// Plan outlines of its parts if it were at `place`.
    pub fn solids_at(&self, placement: &Placement) -> Vec<Footprint> {
        solids_of(&self.parts, placement)
    }

    /// Whether it hangs on a wall: on nothing, and not on the floor.
    pub fn is_hung(&self) -> bool {
        self.placement.parent.is_none() && !self.is_on_floor
    }
}

/// All objects of a house, and the structure around them.
#[derive(Debug, Clone)]
pub struct Layout {
    /// In the order of [`House::objects`].
    pub items: Vec<Item>,
    /// The scene, kept in step with `items`.
    pub scene: Scene,
    /// Walls, doors and windows.
    structure: Vec<(Aabb, Footprint)>,
    /// Plan outlines of the floor in front of doors.
    doorways: Vec<[Vec2; 4]>,
}

impl Layout {
    /// The objects of `house` where it puts them.
    ///
    /// # Arguments
    /// * `scene` - built from the same house.
    ///
    /// # Errors
    /// [`Error::House`] for an unknown asset, if `unknown` says so.
    pub fn new(
        house: &House,
        catalogue: &Catalogue,
        unknown: UnknownAssets,
        scene: Scene,
    ) -> Result<Self, Error> {
        let mut items = Vec::with_capacity(house.objects.len());
        for object in &house.objects {
            let asset = catalogue.asset_of(house, object, unknown)?;
            let parts = shape_in(&asset, object.condition());
            let placement = Placement {
                position_m: object.position_m,
                rotation_deg: object.rotation_deg,
                parent: object.parent,
            };
            let solids = solids_of(&parts, &placement);
            let rule = catalogue.placement(&asset.category);
            let is_hung = rule.is_some_and(|rule| rule.is_placed(Place::Wall));
            let is_on_floor =
                object.parent.is_none() && !is_hung && bottom_m(&solids).abs() < FLOOR_M;
            items.push(Item { asset, parts, placement, solids, is_on_floor });
        }
        let is_solid = |kind| matches!(kind, BodyKind::Wall | BodyKind::Door | BodyKind::Window);
        let structure = scene.bodies[..scene.first_object.min(scene.bodies.len())]
            .iter()
            .filter(|body| is_solid(body.kind))
            .flat_map(|body| &body.parts)
            .filter_map(|part| footprint(part, f64::NEG_INFINITY, f64::INFINITY))
            .map(|solid| (box_of(std::slice::from_ref(&solid)), solid))
            .collect();
        let doorways = house.doors.iter().filter_map(|door| doorway(house, door)).collect();
        Ok(Self { items, scene, structure, doorways })
    }

    /// `root` and everything that stands on it, directly or not; parents first.
    pub fn with_supported(&self, root: usize) -> Vec<usize> {
        let mut family = vec![root];
        let mut next = 0;
        while let Some(&parent) = family.get(next) {
            let children = (0..self.items.len()).filter(|&i| {
                self.items[i].placement.parent == Some(parent) && !family.contains(&i)
            });
            family.extend(children.collect::<Vec<_>>());
            next += 1;
        }
        family
    }

    /// Whether objects can be at `places` without touching anything but each other.
    ///
    /// Furniture is held to whole-height outlines and a gap, so that nothing is pushed under a
    /// table or stood in an arm's reach of nothing; what stands on it to its parts.
    pub fn is_clear(&self, places: &[(usize, Placement)]) -> bool {
        let is_moved = |i: usize| places.iter().any(|&(moved, _)| moved == i);
        places.iter().all(|(index, placement)| {
            let item = &self.items[*index];
            let solids = solids_of(&item.parts, placement);
            let bounds = box_of(&solids);
            let hits_structure = self.structure.iter().any(|(other_box, other)| {
                bounds.intersects(other_box)
                    && solids.iter().any(|solid| collide(solid, other, 0.0))
            });
            let blocks_door = item.is_on_floor
                && self.doorways.iter().any(|doorway| {
                    solids.iter().any(|solid| overlap_m(&solid.outline_m, doorway) > TOUCH_M)
                });
            !hits_structure
                && !blocks_door
                && self
                    .items
                    .iter()
                    .enumerate()
                    .all(|(i, other)| is_moved(i) || !self.hits(item, &solids, &bounds, i, other))
        })
    }

    /// Whether `item`, with `solids`, touches `other`.
    fn hits(
        &self,
        item: &Item,
        solids: &[Footprint],
        bounds: &Aabb,
        other_index: usize,
        other: &Item,
    ) -> bool {
        let Some(body) = self.scene.bodies.get(self.scene.first_object + other_index) else {
            return false;
        };
        let mut near = body.aabb;
        for axis in [0, 2] {
            near.min_m[axis] -= FURNITURE_GAP_M;
            near.max_m[axis] += FURNITURE_GAP_M;
        }
        let are_furniture = item.is_on_floor && other.is_on_floor;
        if are_furniture {
            near.min_m[1] = f64::NEG_INFINITY;
            near.max_m[1] = f64::INFINITY;
        }
        if !bounds.intersects(&near) {
            return false;
        }
        solids.iter().any(|solid| {
            other.solids.iter().any(|its| {
                if are_furniture {
                    overlap_m(&solid.outline_m, &its.outline_m) > -FURNITURE_GAP_M
                } else {
                    collide(solid, its, 0.0)
                }
            })
        })
    }

    /// Puts an object somewhere; what stands on it stays.
    pub fn put(&mut self, index: usize, placement: Placement) {
        let item = &mut self.items[index];
        item.placement = placement;
        item.solids = solids_of(&item.parts, &placement);
        if let Some(body) = self.scene.bodies.get_mut(self.scene.first_object + index) {
            body.parts = world_parts(&item.parts, &placement);
            body.aabb = box_of(&item.solids);
            body.oriented.centre_m = placement.position_m;
            body.oriented.rotation = euler_rotation_deg(placement.rotation_deg);
        }
    }

    /// What differs from `house`, whose objects these are.
    pub fn delta_from(&self, house: &House) -> HouseDelta {
        let moves = self.items.iter().zip(&house.objects).filter_map(|(item, object)| {
            let before = (object.position_m, object.rotation_deg, object.parent);
            let placement = &item.placement;
            let is_same =
                before == (placement.position_m, placement.rotation_deg, placement.parent);
            (!is_same).then(|| ObjectMove {
                id: object.id.clone(),
                position_m: placement.position_m,
                rotation_deg: placement.rotation_deg,
                parent: placement.parent.map(|parent| house.objects[parent].id.clone()),
            })
        });
        HouseDelta { moves: moves.collect(), ..HouseDelta::default() }
    }
}

/// The floor on both sides of a door; `None` if its wall is not there.
fn doorway(house: &House, door: &Opening) -> Option<[Vec2; 4]> {
    let wall = house.walls.iter().find(|wall| wall.id == door.wall0)?;
    let length_m = distance_2d_m(wall.from_m, wall.to_m);
    let along = [0, 1].map(|i| (wall.to_m[i] - wall.from_m[i]) / length_m.max(1e-9));
    let corner = |along_m: f64, across_m: f64| {
        [
            wall.from_m[0] + along_m * along[0] - across_m * along[1],
            wall.from_m[1] + along_m * along[1] + across_m * along[0],
        ]
    };
    let (low, high) = (door.hole_min_m[0], door.hole_max_m[0]);
    Some([
        corner(low, -DOORWAY_M),
        corner(high, -DOORWAY_M),
        corner(high, DOORWAY_M),
        corner(low, DOORWAY_M),
    ])
}

/// Whether two solids share more than a touch, `gap_m` apart or nearer in plan.
fn collide(a: &Footprint, b: &Footprint, gap_m: f64) -> bool {
    a.top_m.min(b.top_m) - a.bottom_m.max(b.bottom_m) > TOUCH_M
        && overlap_m(&a.outline_m, &b.outline_m) > TOUCH_M - gap_m
}

/// A shape in the world.
fn world_parts(parts: &[Part], placement: &Placement) -> Vec<Part> {
    let rotation = euler_rotation_deg(placement.rotation_deg);
    parts.iter().map(|part| part.placed(placement.position_m, &rotation)).collect()
}

/// Plan outlines of a shape in the world.
fn solids_of(parts: &[Part], placement: &Placement) -> Vec<Footprint> {
    world_parts(parts, placement)
        .iter()
        .filter_map(|part| footprint(part, f64::NEG_INFINITY, f64::INFINITY))
        .collect()
}

/// Lowest height of solids.
pub fn bottom_m(solids: &[Footprint]) -> f64 {
    solids.iter().map(|solid| solid.bottom_m).fold(f64::INFINITY, f64::min)
}

/// Box around solids.
pub fn box_of(solids: &[Footprint]) -> Aabb {
    Aabb::of_points(solids.iter().flat_map(|solid| {
        solid
            .outline_m
            .iter()
            .flat_map(|p| [[p[0], solid.bottom_m, p[1]], [p[0], solid.top_m, p[1]]])
    }))
}
