//! What generation leaves on record; the JSON that Python's `evonav.tasks.oracle` reads.

use serde::Serialize;

use crate::{
    assets::shapes::Detail,
    evolution::Mode,
    geometry::{Vec2, Vec3},
    house::{AddedObject, HouseDelta, ObjectMove, StateChange},
};

/// A generated task.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GeneratedTask {
    /// Stages, from the first.
    pub stages: Vec<GeneratedStage>,
    /// House of each stage, JSON.
    #[serde(skip)]
    pub houses: Vec<String>,
    /// Reference image of each stage, RGB, row by row.
    #[serde(skip)]
    pub images: Vec<Vec<u8>>,
}

/// Why no task was made of a house.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Rejected {
    /// Which check it failed.
    pub reason: RejectReason,
    /// The stage at hand; 0 before the first.
    pub stage: usize,
    /// What was found.
    pub detail: String,
}

/// Checks that a house must pass.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum RejectReason {
    /// Fewer than two rooms (paper, Sec. 3.2).
    TooFewRooms,
    /// The house file has no start pose.
    NoStart,
    /// The house's own start pose, or anything within snapping distance, is not free.
    StartNotFree,
    /// The start is in no room.
    StartOutside,
    /// Fewer than two rooms can be reached from the start.
    Disconnected,
    /// No object of the house has a reference pose from which it is visible.
    NoValidGoal,
}

/// One stage.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GeneratedStage {
    /// ΔH_k, with its history.
    pub evolution: EvolutionRecord,
    /// S before the stage.
    pub state: StateRecord,
    /// Reference start s_k.
    pub start_pose: PoseRecord,
    /// x_k.
    pub target: TargetRecord,
    /// Goals drawn and refused before.
    pub rejections: Vec<RejectionRecord>,
    /// Where the reference image was taken.
    pub reference_pose: PoseRecord,
    /// Pixels of the target in it.
    pub reference_visible_px: usize,
    /// What the target looks like.
    pub appearance: Appearance,
    /// Corners of the shortest path to it.
    pub reference_path_m: Vec<Vec2>,
    /// Its length.
    pub reference_path_length_m: f64,
    /// Ids of all objects that any change so far relocated, sorted.
    pub ever_relocated_ids: Vec<String>,
    /// What an instruction may say of the target's surroundings.
    pub relations: Relations,
}

/// A pose as AI2-THOR writes it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PoseRecord {
    /// Middle of the body.
    pub position_m: Vec3,
    /// Heading.
    pub yaw_deg: f64,
    /// Pitch, positive looking down.
    pub horizon_deg: f64,
}

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

/// S.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StateRecord {
    /// Rooms on the reference trajectory, in house order.
    pub visited_room_ids: Vec<String>,
    /// Room changed at each of the last two transitions.
    pub changed_room_ids: Vec<Option<String>>,
    /// Goal rooms of the last two stages.
    pub goal_room_ids: Vec<String>,
    /// Room in which the reference trajectory ends.
    pub transition_room_id: Option<String>,
}

/// A refused goal.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RejectionRecord {
    /// Object.
    pub id: String,
    /// Why.
    pub reason: GoalRejection,
}

/// Why an object cannot be a goal.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum GoalRejection {
    /// No reachable position of its room lies at the reference distance.
    NoReferencePose,
    /// It is not visible from any of them.
    NotVisible,
    /// No path leads there.
    Unreachable,
}

/// x_k.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TargetRecord {
    /// Object.
    pub id: String,
    /// Its category.
    pub category: String,
    /// Its room.
    pub room_id: String,
    /// Centre of its box.
    pub position_m: Vec3,
    /// Size of its box at zero yaw.
    pub size_m: Vec3,
    /// What it stands on.
    pub support_id: Option<String>,
    /// Target score.
    pub score: f64,
    /// Others of its category.
    pub same_category_ids: Vec<String>,
    /// By this stage's change.
    pub is_relocated_now: bool,
    /// By any change so far.
    pub is_relocated_ever: bool,
}

/// What surrounds a target, in categories (paper, Sec. A.4).
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Relations {
    /// Type of its room.
    pub room_type: String,
    /// Whether no other object of the house has its category.
    pub is_category_unique: bool,
    /// Whether no other room of the house is of its room's type.
    pub is_room_type_unique: bool,
    /// What it stands on or in.
    pub support: Option<Anchor>,
    /// Whether it is in its support: in a basin, or behind a door.
    pub is_in_support: bool,
    /// At most two things next to it, nearest first.
    pub neighbours: Vec<Anchor>,
    /// `doorway`, `window` or `corner` near it.
    pub structure: Option<Anchor>,
    /// Something on the wall near it.
    pub wall_object: Option<Anchor>,
    /// Whether that hangs above it.
    pub is_below_wall_object: bool,
    /// Objects of the house that all of this fits, read literally; the target is one.
    pub num_fitting: usize,
}

/// A thing that an instruction refers to.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Anchor {
    /// Its category, or the word for a part of the room.
    pub category: String,
    /// Which of its category.
    pub determiner: Determiner,
}

/// How a thing is referred to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Determiner {
    /// The only one in the room.
    The,
    /// One of several in the room.
    A,
    /// Two or more that are all next to the target.
    Some,
}

/// What a target looks like.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Appearance {
    /// Colours that show in the reference image, the largest share first.
    pub tints: Vec<Tint>,
    /// `round`, `L-shaped` or `U-shaped`, where its category has other forms too.
    pub form: Option<&'static str>,
    /// Parts by which it can be told.
    pub details: Vec<Detail>,
    /// What it is made of, the most important first.
    pub made_of: Vec<String>,
}

/// A material's colour in an image.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Tint {
    /// Of the material, sRGB.
    pub colour: [u8; 3],
    /// Of the target's pixels, 0..1.
    pub share: f64,
}
