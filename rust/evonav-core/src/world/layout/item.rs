//! One object of a layout: its place, and what it covers there.

use crate::{
    assets::{Asset, part::Part},
    geometry::{Aabb, Vec3, euler_rotation_deg},
    world::{
        footprint::{Footprint, footprint},
        layout::contact::box_of,
    },
};

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
    pub(super) parts: Vec<Part>,
    /// Where it is now.
    pub placement: Placement,
    /// Plan outlines of its parts, with their heights.
    pub solids: Vec<Footprint>,
    /// Box around them.
    pub bounds: Aabb,
    /// Where the file has it: what it stands on, and its height ...
    pub(super) filed: (Option<usize>, f64),
    /// ... and how far below the scene has it: files hold some things over what they stand on.
    pub(super) sunk_m: f64,
    /// Stands on the floor by itself: furniture, and boxes and balls on the floor.
    pub is_on_floor: bool,
}

impl Item {
    /// Plan outlines of its parts if it were at `place`.
    pub fn solids_at(&self, placement: &Placement) -> Vec<Footprint> {
        solids_of(&self.parts, &self.settled(placement))
    }

    /// Where it comes to rest: what is carried along lies as far below its place as before.
    pub(super) fn settled(&self, placement: &Placement) -> Placement {
        let mut settled = *placement;
        if (placement.parent, placement.position_m[1]) == self.filed {
            settled.position_m[1] -= self.sunk_m;
        }
        settled
    }

    /// Height of its centre over its lowest point.
    pub fn rise_m(&self) -> f64 {
        self.settled(&self.placement).position_m[1] - self.bounds.min_m[1]
    }

    /// Brings outlines and box to where it is.
    pub(super) fn settle(&mut self) {
        self.solids = self.solids_at(&self.placement);
        self.bounds = box_of(&self.solids);
    }

    /// Whether it hangs on a wall: on nothing, and not on the floor.
    pub fn is_hung(&self) -> bool {
        self.placement.parent.is_none() && !self.is_on_floor
    }
}

/// A member at a new place.
#[derive(Debug, Clone)]
pub struct Placed {
    /// Index of the object.
    pub index: usize,
    /// Whether it stands on the floor by itself.
    pub is_root: bool,
    /// Its place.
    pub placement: Placement,
    /// Plan outlines of its parts there, up to rounding.
    pub solids: Vec<Footprint>,
}

/// A shape in the world.
pub(super) fn world_parts(parts: &[Part], placement: &Placement) -> Vec<Part> {
    let rotation = euler_rotation_deg(placement.rotation_deg);
    parts.iter().map(|part| part.placed(placement.position_m, &rotation)).collect()
}

/// Plan outlines of a shape in the world.
pub(super) fn solids_of(parts: &[Part], placement: &Placement) -> Vec<Footprint> {
    world_parts(parts, placement)
        .iter()
        .filter_map(|part| footprint(part, f64::NEG_INFINITY, f64::INFINITY))
        .collect()
}
