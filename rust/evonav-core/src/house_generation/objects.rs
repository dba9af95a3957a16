//! The objects of a house while it is made, as the file lists them.

use crate::{
    assets::{Asset, Catalogue},
    geometry::Vec3,
    house_generation::{
        interior::{Piece, PlacedObject},
        parameters::HouseParameters,
        sampling::happens,
        structure::Structure,
    },
    rng::Stream,
};

/// The kind of place that an object has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// It stands on the floor, or on another member of its asset group.
    Furniture,
    /// It hangs on a wall.
    Hung,
    /// A small object on furniture.
    Small,
}

/// An object of the house.
#[derive(Debug, Clone)]
pub(super) struct HouseObject {
    pub id: String,
    pub asset: &'static Asset,
    pub kind: Kind,
    /// Index of its room.
    pub room: usize,
    /// Centre of its box.
    pub position_m: Vec3,
    /// Unity Euler angles.
    pub rotation_deg: Vec3,
    /// Index of the object that it stands on, which comes before it.
    pub parent: Option<usize>,
    pub openness: Option<f64>,
    pub is_on: Option<bool>,
    pub is_dirty: Option<bool>,
}

impl HouseObject {
    /// Return whether files fix it in place.
    pub fn is_kinematic(&self) -> bool {
        let rule = Catalogue::bundled().placement(&self.asset.category);
        rule.is_some_and(|rule| rule.is_kinematic) || self.kind == Kind::Hung
    }
}

/// List furniture and hung objects with their ids in the order of files, and draw their states.
pub(super) fn listed(
    parameters: &HouseParameters,
    structure: &Structure,
    furniture: &[Vec<Piece>],
    hung: Vec<Vec<PlacedObject>>,
    stream: &mut Stream,
) -> Vec<HouseObject> {
    let rules = &parameters.appearance;
    let mut objects: Vec<HouseObject> = Vec::new();
    let mut add = |id: String, kind, room, placed: &PlacedObject, parent| {
        let category = &placed.asset.category;
        let mut toss = |list: &[String]| list.contains(category).then(|| happens(stream, 0.5));
        objects.push(HouseObject {
            id,
            asset: placed.asset,
            kind,
            room,
            position_m: placed.position_m,
            rotation_deg: placed.rotation_deg,
            parent,
            openness: placed.openness,
            is_on: toss(&rules.toggled),
            is_dirty: toss(&rules.dirtied),
        });
        objects.len() - 1
    };
    for (room, (pieces, hung)) in furniture.iter().zip(hung).enumerate() {
        let number = structure.rooms[room].number;
        for (piece_number, piece) in pieces.iter().enumerate() {
            let mut members = vec![0; piece.objects.len()];
            for member in depth_first(&piece.objects) {
                let placed = &piece.objects[member];
                let id = match piece.is_group {
                    true => format!("{number}|{piece_number}|{member}"),
                    false => format!("{number}|{piece_number}"),
                };
                let parent = placed.parent.map(|parent| members[parent]);
                members[member] = add(id, Kind::Furniture, room, placed, parent);
            }
        }
        for (hung_number, placed) in hung.iter().enumerate() {
            let id = format!("{number}|{}", pieces.len() + hung_number);
            add(id, Kind::Hung, room, placed, None);
        }
    }
    objects
}

/// Return the order in which files list the members of a piece: each is followed by those on it.
fn depth_first(objects: &[PlacedObject]) -> Vec<usize> {
    let mut order = Vec::with_capacity(objects.len());
    let mut open: Vec<usize> =
        (0..objects.len()).rev().filter(|&index| objects[index].parent.is_none()).collect();
    while let Some(index) = open.pop() {
        order.push(index);
        open.extend((0..objects.len()).rev().filter(|&i| objects[i].parent == Some(index)));
    }
    order
}
