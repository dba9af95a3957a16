//! The objects of a house while they are moved about: places, outlines and collisions.

use crate::{
    Error,
    assets::{
        Catalogue, UnknownAssets,
        placement_rule::Place,
        shapes::{Shape, trimmed_shape},
    },
    geometry::{
        Aabb, add, bounds_2d_m, euler_rotation_deg, outline::overlap_m, rotate, sub, yaw_rotation,
    },
    house::{House, HouseDelta, ObjectMove},
    world::{
        footprint::{Footprint, footprint},
        layout::{
            Item, PlacedItem, Placement,
            contact::{TOUCH_M, bottom_m, box_of, collide},
            free_floor::{self, FloorPatch},
            item::solids_of,
            rounding::{ROUND_M, round_to, turned_deg},
        },
        scene::{BodyKind, Scene},
    },
};

/// Smallest gap between two pieces of furniture.
const FURNITURE_GAP_M: f64 = 0.02;
/// Height of the bottom below which an object without a parent stands on the floor.
const FLOOR_M: f64 = 0.05;

/// All objects of a house, and the structure around them.
#[derive(Debug, Clone)]
pub struct Layout {
    /// The objects, in the order of [`House::objects`].
    pub items: Vec<Item>,
    /// The scene; its bodies move together with `items`.
    pub scene: Scene,
    /// Outlines of walls, doors and windows, with their boxes.
    structure: Vec<(Aabb, Footprint)>,
    /// Floor on which no furniture may stand.
    passages: Vec<FloorPatch>,
}

impl Layout {
    /// Create the layout of `house` as it is.
    ///
    /// # Arguments
    /// * `scene` - built from the same house.
    ///
    /// # Errors
    /// [`Error::House`] for an unknown asset, unless `unknown` allows it.
    pub fn new(
        house: &House,
        catalogue: &Catalogue,
        unknown: UnknownAssets,
        scene: Scene,
    ) -> Result<Self, Error> {
        let mut items = Vec::with_capacity(house.objects.len());
        for (index, object) in house.objects.iter().enumerate() {
            let asset = catalogue.asset_of(house, object, unknown)?;
            let shape = trimmed_shape(&asset, object.condition());
            let placement = Placement {
                position_m: object.position_m,
                rotation_deg: object.rotation_deg,
                parent: object.parent,
            };
            let solids = solids_of(&shape.parts, &placement);
            let rule = catalogue.placement(&asset.category);
            let is_hung = rule.is_some_and(|rule| rule.is_placed(Place::Wall));
            let is_on_floor =
                object.parent.is_none() && !is_hung && bottom_m(&solids).abs() < FLOOR_M;
            let bounds = box_of(&solids);
            let body = scene.bodies.get(scene.first_object + index);
            let sunk_m = body.map_or(0.0, |body| bounds.min_m[1] - body.aabb.min_m[1]);
            let in_file = (placement.parent, placement.position_m[1]);
            let mut item =
                Item { asset, shape, placement, solids, bounds, in_file, sunk_m, is_on_floor };
            item.settle();
            items.push(item);
        }
        let is_solid = |kind| matches!(kind, BodyKind::Wall | BodyKind::Door | BodyKind::Window);
        let structure = scene.bodies[..scene.first_object.min(scene.bodies.len())]
            .iter()
            .filter(|body| is_solid(body.kind))
            .flat_map(|body| &body.parts)
            .filter_map(|part| footprint(part, f64::NEG_INFINITY, f64::INFINITY))
            .map(|solid| (box_of(std::slice::from_ref(&solid)), solid))
            .collect();
        Ok(Self { items, scene, structure, passages: free_floor::passages(house) })
    }

    /// Put every object exactly where the file has it, even if it hangs in the air there.
    pub fn with_file_positions(mut self) -> Self {
        for item in &mut self.items {
            item.sunk_m = 0.0;
            item.settle();
        }
        self
    }

    /// Return `root` and everything that stands on it, directly or not; parents first.
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

    /// Return the places of an object that is moved to `place` and of all objects on it, which move
    /// rigidly with it.
    pub fn carry(&self, index: usize, place: Placement) -> Vec<(usize, Placement)> {
        let old = self.items[index].placement;
        let turn_deg = place.rotation_deg[1] - old.rotation_deg[1];
        let turn = yaw_rotation(turn_deg.to_radians());
        let mut places = vec![(index, place)];
        for member in self.with_supported(index).into_iter().skip(1) {
            let mut moved = self.items[member].placement;
            let offset = rotate(&turn, sub(moved.position_m, old.position_m));
            moved.position_m = add(place.position_m, offset).map(|v| round_to(v, ROUND_M));
            moved.rotation_deg[1] = turned_deg(moved.rotation_deg[1] + turn_deg);
            places.push((member, moved));
        }
        places
    }

    /// Return the floor on which no furniture may stand: in front of doors and along open-plan
    /// borders.
    pub fn passages(&self) -> &[FloorPatch] {
        &self.passages
    }

    /// Return whether objects can be at `places` without touching anything but each other.
    ///
    /// Furniture is compared by whole outlines whatever their heights, and with a gap, so that no
    /// piece is pushed under a table. Objects on furniture are compared part by part.
    pub fn is_clear(&self, places: &[(usize, Placement)]) -> bool {
        let placed = |&(index, placement): &(usize, Placement)| PlacedItem {
            index,
            is_root: self.items[index].is_on_floor,
            placement,
            solids: self.items[index].solids_at(&placement),
        };
        self.is_free(&places.iter().map(placed).collect::<Vec<_>>())
    }

    /// Return whether objects can be at their places, as [`Self::is_clear`], by the outlines given
    /// with the places.
    pub fn is_free(&self, placed: &[PlacedItem]) -> bool {
        let boxes: Vec<Aabb> = placed.iter().map(|member| box_of(&member.solids)).collect();
        let is_off_passages = placed.iter().zip(&boxes).all(|(member, bounds)| {
            !self.items[member.index].is_on_floor || self.is_off_passages(&member.solids, bounds)
        });
        if !is_off_passages {
            return false;
        }
        let hits_structure = |(member, bounds): (&PlacedItem, &Aabb)| {
            self.structure.iter().any(|(other_box, other)| {
                bounds.intersects(other_box)
                    && member.solids.iter().any(|solid| collide(solid, other, 0.0))
            })
        };
        if placed.iter().zip(&boxes).any(hits_structure) {
            return false;
        }
        let mut is_moved = vec![false; self.items.len()];
        for member in placed {
            is_moved[member.index] = true;
        }
        let all = boxes.iter().fold(Aabb::EMPTY, |all, bounds| all.union(*bounds));
        let others = self.items.iter().enumerate().filter(|(index, _)| !is_moved[*index]);
        // Furniture counts with its whole height: no box is too high or too low to be near.
        let is_near = |other: &Item| {
            [0, 2].iter().all(|&axis| {
                all.min_m[axis] - FURNITURE_GAP_M <= other.bounds.max_m[axis]
                    && other.bounds.min_m[axis] <= all.max_m[axis] + FURNITURE_GAP_M
            })
        };
        others.filter(|(_, other)| is_near(other)).all(|(_, other)| {
            placed.iter().zip(&boxes).all(|(member, bounds)| {
                !hits(&self.items[member.index], &member.solids, bounds, other)
            })
        })
    }

    fn is_off_passages(&self, solids: &[Footprint], bounds: &Aabb) -> bool {
        self.passages.iter().all(|floor| {
            let [low, high] = bounds_2d_m(*floor);
            let is_beside = [0, 1].iter().any(|&axis| {
                bounds.max_m[2 * axis] < low[axis] || high[axis] < bounds.min_m[2 * axis]
            });
            is_beside || !solids.iter().any(|s| overlap_m(&s.outline_m, floor) > TOUCH_M)
        })
    }

    /// Move an object; objects on it stay where they are.
    pub fn put(&mut self, index: usize, placement: Placement) {
        let item = &mut self.items[index];
        item.placement = placement;
        item.settle();
        if let Some(body) = self.scene.bodies.get_mut(self.scene.first_object + index) {
            let settled = item.settled(&placement);
            let rotation = euler_rotation_deg(placement.rotation_deg);
            Shape { parts: body.parts, trim: body.trim } =
                item.shape.placed(settled.position_m, &rotation);
            body.aabb = item.bounds;
            body.oriented.centre_m = settled.position_m;
            body.oriented.rotation = rotation;
        }
    }

    /// Return the moves from `house`, of which this is a layout, to this layout.
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

/// Return whether `item`, with `solids`, touches `other`.
fn hits(item: &Item, solids: &[Footprint], bounds: &Aabb, other: &Item) -> bool {
    let are_furniture = item.is_on_floor && other.is_on_floor;
    let gap_m = if are_furniture { FURNITURE_GAP_M } else { 0.0 };
    let is_near = (0..3).all(|axis| {
        (axis == 1 && are_furniture)
            || (bounds.min_m[axis] - gap_m <= other.bounds.max_m[axis]
                && other.bounds.min_m[axis] <= bounds.max_m[axis] + gap_m)
    });
    is_near
        && solids.iter().any(|solid| {
            other.solids.iter().any(|its| match are_furniture {
                true => overlap_m(&solid.outline_m, &its.outline_m) > -FURNITURE_GAP_M,
                false => collide(solid, its, 0.0),
            })
        })
}
