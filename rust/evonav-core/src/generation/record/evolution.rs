//! Records of the hidden change before a stage.

use serde::Serialize;

use crate::{generation::Mode, geometry::Vec3};

/// The outcome of a transition.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum EvolutionOutcome {
    /// There is no transition before stage 1.
    #[default]
    FirstStage,
    /// The draw decided against an evolution.
    NotTriggered,
    /// All rooms have weight 0.
    NoRoom,
    /// Nothing in the drawn room could be moved; [`EvolutionRecord::failure`] gives the reason.
    NoPlacement,
    /// The room changed.
    Evolved,
}

/// ΔH_k, with the weights from which it was drawn.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct EvolutionRecord {
    /// Outcome of the transition.
    pub outcome: EvolutionOutcome,
    /// Drawn mode.
    pub mode: Option<Mode>,
    /// Id of the drawn room.
    pub room_id: Option<String>,
    /// Id of the object that `SALIENT_OBJECT` moved.
    pub salient_id: Option<String>,
    /// Factors of every room's weight; empty if not triggered.
    pub room_weights: Vec<RoomWeightRecord>,
    /// Reason why nothing could be moved; only with [`EvolutionOutcome::NoPlacement`].
    pub failure: Option<ModificationFailure>,
    /// All objects whose pose or support differs.
    pub changes: Vec<ChangeRecord>,
    /// Ids of the objects that were to move and could not.
    pub unmoved_ids: Vec<String>,
    /// Ids of those among them that had free places, each of which would have cut something off.
    pub blocking_ids: Vec<String>,
    /// Ids of furniture that stands without the free floor that ProcTHOR leaves around it.
    pub crowded_ids: Vec<String>,
    /// Ids of furniture of groups that fitted nowhere as they stood and were rearranged by
    /// ProcTHOR's definition of the group.
    pub rearranged_ids: Vec<String>,
    /// Objects that appeared. Only extensions fill this field and the following ones.
    pub additions: Vec<ObjectRecord>,
    /// Objects that vanished, as they were.
    pub removals: Vec<ObjectRecord>,
    /// Doors and objects that were opened, closed, or switched on or off.
    pub states: Vec<StateChangeRecord>,
    /// Time of day of the stage, minutes after midnight, if people have a schedule.
    pub clock_min: Option<usize>,
    /// Activities of people since the previous stage.
    pub activities: Vec<ActivityRecord>,
}

impl EvolutionRecord {
    /// Create the record of a transition without change.
    pub(crate) fn unchanged(outcome: EvolutionOutcome) -> Self {
        Self { outcome, ..Self::default() }
    }
}

/// Reasons why nothing in a room could be moved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ModificationFailure {
    /// The room has nothing that the modification moves.
    NothingMovable,
    /// None of the drawn places was free.
    NoFreePlace,
    /// Every free place cut off a room or object.
    CutsOff,
}

/// The factors of a room's weight.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct RoomHistory {
    /// Number of objects in the room, children included.
    pub num_assets: usize,
    /// Whether the reference trajectory has been in it.
    pub is_visited: bool,
    /// Whether the reference trajectory ends in it.
    pub is_transition_room: bool,
    /// Whether it changed within the last `changed_room_window` transitions.
    pub was_changed_recently: bool,
}

/// The weight of one room.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RoomWeightRecord {
    /// Id of the room.
    pub room_id: String,
    /// Factors of the weight.
    #[serde(flatten)]
    pub history: RoomHistory,
    /// Product of the factors, not normalised.
    pub weight: f64,
}

/// The move of one object.
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
    /// Whether it moved farther than `relocated_min_m`, or to another support.
    pub is_relocated: bool,
    /// Process that moved it: the mode, or an extension.
    pub cause: String,
}

/// An object that appeared or vanished.
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
    /// Id of the object that it stands or stood on.
    pub support_id: Option<String>,
    /// Process that changed it: `INSERTION` or `REMOVAL`.
    pub cause: String,
}

/// A change of the state of a door or an object.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StateChangeRecord {
    /// Id of the door or object.
    pub id: String,
    /// Its category.
    pub category: String,
    /// Changed field: `openness` or `isOn`, as in house files.
    pub field: &'static str,
    /// Value before: openness, or 1 for on.
    pub before: f64,
    /// Value after.
    pub after: f64,
    /// Extension that changed it.
    pub cause: String,
}

/// An activity of one person.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct ActivityRecord {
    /// Number of the person, from 0.
    pub person: usize,
    /// Name of the activity, as in `ACTIVITY:<name>`.
    pub name: String,
    /// Id of the room; `None` away from home.
    pub room_id: Option<String>,
    /// Start, minutes after midnight of the first stage's day.
    pub start_min: usize,
    /// End, minutes after midnight of the first stage's day.
    pub end_min: usize,
}
