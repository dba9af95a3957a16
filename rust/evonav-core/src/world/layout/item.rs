//! One object of a layout: its place and its outlines there.

use crate::{
    assets::{Asset, part::Part, shapes::Shape},
    geometry::{Aabb, Vec3, euler_rotation_deg},
    world::{
        footprint::{Footprint, footprint},
        layout::contact::box_of,
    },
};

/// The place of an object.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    /// Centre of its box.
    pub position_m: Vec3,
    /// Unity Euler angles, degrees.
    pub rotation_deg: Vec3,
    /// Index of the object that it stands on or in.
    pub parent: Option<usize>,
}

/// One object of a layout.
#[derive(Debug, Clone)]
pub struct Item {
    /// Asset of the object.
    pub asset: Asset,
    /// Shape of the object, object frame.
    pub(super) shape: Shape,
    /// Present place.
    pub placement: Placement,
    /// Outlines of its parts on the ground plane, with their heights.
    pub solids: Vec<Footprint>,
    /// Box around the outlines.
    pub bounds: Aabb,
    /// Parent and height in the house file.
    pub(super) in_file: (Option<usize>, f64),
    /// Height by which the scene has it below the file: files have some objects over their support.
    pub(super) sunk_m: f64,
    /// Whether it stands on the floor by itself: furniture, and boxes and balls on the floor.
    pub is_on_floor: bool,
}

impl Item {
    /// Return the outlines of its parts if it were at `placement`.
    pub fn solids_at(&self, placement: &Placement) -> Vec<Footprint> {
        solids_of(&self.shape.parts, &self.settled(placement))
    }

    /// Return the place where it comes to rest: an object that is carried along lies as far below
    /// its place as before.
    pub(super) fn settled(&self, placement: &Placement) -> Placement {
        let mut settled = *placement;
        if (placement.parent, placement.position_m[1]) == self.in_file {
            settled.position_m[1] -= self.sunk_m;
        }
        settled
    }

    /// Return the height of its centre over its lowest point.
    pub fn rise_m(&self) -> f64 {
        self.settled(&self.placement).position_m[1] - self.bounds.min_m[1]
    }

    /// Update outlines and box to the present place.
    pub(super) fn settle(&mut self) {
        self.solids = self.solids_at(&self.placement);
        self.bounds = box_of(&self.solids);
    }

    /// Return whether it hangs on a wall: it has no parent and is not on the floor.
    pub fn is_hung(&self) -> bool {
        self.placement.parent.is_none() && !self.is_on_floor
    }
}

/// An object at a new place.
#[derive(Debug, Clone)]
pub struct PlacedItem {
    /// Index of the object.
    pub index: usize,
    /// Whether the object stands on the floor by itself.
    pub is_root: bool,
    /// New place.
    pub placement: Placement,
    /// Outlines of its parts at the new place, up to rounding.
    pub solids: Vec<Footprint>,
}

/// Return the outlines of a shape at a place in the world.
pub(super) fn solids_of(parts: &[Part], placement: &Placement) -> Vec<Footprint> {
    let rotation = euler_rotation_deg(placement.rotation_deg);
    let in_world = parts.iter().map(|part| part.placed(placement.position_m, &rotation));
    in_world.filter_map(|part| footprint(&part, f64::NEG_INFINITY, f64::INFINITY)).collect()
}
