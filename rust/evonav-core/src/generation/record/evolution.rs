//! The hidden change before a stage.

use serde::Serialize;

use crate::{
    generation::Mode,
    geometry::Vec3,
    house::{AddedObject, HouseDelta, ObjectMove, StateChange},
};

/// How a transition went.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum EvolutionOutcome {
    /// There is no transition before stage 1.
    FirstStage,
    /// The draw said no.
    NotTriggered,
    /// All rooms have weight 0.
    NoRoom,
    /// Nothing in the drawn room could be moved, [`EvolutionRecord::failure`] says why.
    NoPlacement,
    /// The room changed.
    Evolved,
}

/// ΔH_k, with what it was drawn from.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EvolutionRecord {
    /// How it went.
    pub outcome: EvolutionOutcome,
    /// Drawn modification.
    pub mode: Option<Mode>,
    /// Drawn room.
    pub room_id: Option<String>,
    /// What `SALIENT_OBJECT` moved.
    pub salient_id: Option<String>,
    /// Factors of every room's weight; empty when not triggered.
    pub room_weights: Vec<RoomWeightRecord>,
    /// Why nothing could be moved; only with [`EvolutionOutcome::NoPlacement`].
    pub failure: Option<ModificationFailure>,
    /// Every object whose pose or support differs.
    pub changes: Vec<ChangeRecord>,
    /// Objects that were to move and could not.
    pub unmoved_ids: Vec<String>,
    /// Those of them that had free places, each of which would have cut something off.
    pub blocking_ids: Vec<String>,
    /// Furniture that had to do without the free floor that ProcTHOR leaves around it.
    pub crowded_ids: Vec<String>,
    /// Furniture of groups that fitted nowhere as they stood: arranged anew by ProcTHOR's
    /// definition of the group.
    pub rearranged_ids: Vec<String>,
    /// Objects that were not there before; by an extension, as all below.
    pub additions: Vec<ObjectRecord>,
    /// Objects that are there no more, as they were.
    pub removals: Vec<ObjectRecord>,
    /// Doors and objects that opened, closed, or went on or off.
    pub states: Vec<StateChangeRecord>,
    /// Time of day of the stage, minutes after midnight, where people have a schedule.
    pub clock_min: Option<usize>,
    /// What people did since the stage before.
    pub activities: Vec<ActivityRecord>,
}

impl EvolutionRecord {
    /// The change as it is applied to the house of the stage before.
    pub fn delta(&self) -> HouseDelta {
        let moves = self.changes.iter().map(|change| ObjectMove {
            id: change.id.clone(),
            position_m: change.to_position_m,
            rotation_deg: change.to_rotation_deg,
            parent: change.to_support_id.clone(),
        });
        let added = self.additions.iter().map(|object| AddedObject {
            id: object.id.clone(),
            asset_id: object.asset_id.clone(),
            position_m: object.position_m,
            rotation_deg: object.rotation_deg,
            parent: object.support_id.clone(),
        });
        let states = self.states.iter().map(|change| StateChange {
            id: change.id.clone(),
            openness: (change.field == "openness").then_some(change.after),
            is_on: (change.field == "isOn").then_some(change.after > 0.0),
        });
        HouseDelta {
            moves: moves.collect(),
            removed: self.removals.iter().map(|object| object.id.clone()).collect(),
            added: added.collect(),
            states: states.collect(),
        }
    }
}

/// Why nothing in a room could be moved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ModificationFailure {
    /// There is nothing in it that the modification moves.
    NothingMovable,
    /// No place drawn was free.
    NoFreePlace,
    /// Every free place cut off a room or object.
    CutsOff,
}

/// One room's weight.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RoomWeightRecord {
    /// Room.
    pub room_id: String,
    /// Objects in it.
    pub num_assets: usize,
    /// On the reference trajectory so far.
    pub is_visited: bool,
    /// The reference trajectory ends in it.
    pub is_transition_room: bool,
    /// Changed within the window.
    pub was_changed_recently: bool,
    /// Product, not normalised.
    pub weight: f64,
}

/// One object's move.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ChangeRecord {
    /// Object.
    pub id: String,
    /// Its category.
    pub category: String,
    /// Centre before.
    pub from_position_m: Vec3,
    /// Euler angles before.
    pub from_rotation_deg: Vec3,
    /// Support before.
    pub from_support_id: Option<String>,
    /// Centre after.
    pub to_position_m: Vec3,
    /// Euler angles after.
    pub to_rotation_deg: Vec3,
    /// Support after.
    pub to_support_id: Option<String>,
    /// Distance of the centres.
    pub displacement_m: f64,
    /// Farther than `relocated_min_m`, or on another support.
    pub is_relocated: bool,
    /// The process that moved it: the mode, or an extension.
    pub cause: String,
}

/// An object that came or went.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ObjectRecord {
    /// Object.
    pub id: String,
    /// Its category.
    pub category: String,
    /// Key of the asset catalogue.
    pub asset_id: String,
    /// Centre of its box.
    pub position_m: Vec3,
    /// Euler angles.
    pub rotation_deg: Vec3,
    /// What it stands or stood on.
    pub support_id: Option<String>,
    /// `INSERTION` or `REMOVAL`.
    pub cause: String,
}

/// A state of a door or an object that changed.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StateChangeRecord {
    /// Door or object.
    pub id: String,
    /// Its category.
    pub category: String,
    /// `openness` or `isOn`, as house files call it.
    pub field: &'static str,
    /// Before: openness, or 1 for on.
    pub before: f64,
    /// After.
    pub after: f64,
    /// The extension.
    pub cause: String,
}

/// What one person did.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct ActivityRecord {
    /// Who, from 0.
    pub person: usize,
    /// What, as in `ACTIVITY:<name>`.
    pub name: String,
    /// Where; `None` away from home.
    pub room_id: Option<String>,
    /// Begin, minutes after midnight of the first stage's day.
    pub start_min: usize,
    /// End.
    pub end_min: usize,
}
