//! Records of a generated task and its stages.

use serde::Serialize;

use crate::{
    generation::record::{Appearance, EvolutionRecord, Relations, TargetRecord},
    geometry::{Vec2, Vec3},
};

/// A generated task.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GeneratedTask {
    /// Stages, in order.
    pub stages: Vec<GeneratedStage>,
    /// House of each stage, as JSON.
    #[serde(skip)]
    pub houses: Vec<String>,
    /// Reference image of each stage, RGB, row by row.
    #[serde(skip)]
    pub images: Vec<Vec<u8>>,
}

/// The reason why no task was generated from a house.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Rejected {
    /// The check that the house failed.
    pub reason: RejectReason,
    /// Stage at which it failed; 0 before the first.
    pub stage: usize,
    /// Values found.
    pub detail: String,
}

/// Reasons for which a house is rejected.
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
    /// ΔH_k, the change before the stage.
    pub evolution: EvolutionRecord,
    /// Generation state S before the stage.
    pub state: StateRecord,
    /// Reference start s_k.
    pub start_pose: PoseRecord,
    /// Target x_k.
    pub target: TargetRecord,
    /// Goals that were drawn before and rejected.
    pub rejections: Vec<RejectionRecord>,
    /// Pose at which the reference image was taken.
    pub reference_pose: PoseRecord,
    /// Number of pixels of the target in the reference image.
    pub reference_visible_px: usize,
    /// Appearance of the target.
    pub appearance: Appearance,
    /// Corners of the shortest path to the reference pose.
    pub reference_path_m: Vec<Vec2>,
    /// Length of the reference path.
    pub reference_path_length_m: f64,
    /// Ids of all objects that any change so far has relocated, sorted.
    pub ever_relocated_ids: Vec<String>,
    /// Surroundings of the target, for the instruction.
    pub relations: Relations,
    /// Change during the stage; left out if there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub during: Option<DuringRecord>,
}

/// A change of the house during a stage.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DuringRecord {
    /// Decision round, from 0, before whose views the house changes.
    pub round: usize,
    /// The change.
    pub evolution: EvolutionRecord,
    /// Centre of the target's box after it.
    pub target_position_m: Vec3,
    /// Object that the target stands on after it.
    pub target_support_id: Option<String>,
    /// Whether it relocated the target.
    pub is_target_relocated: bool,
    /// Pose at the reference distance from which the target is visible after it.
    pub reference_pose: PoseRecord,
    /// Number of pixels of the target from there.
    pub reference_visible_px: usize,
}

/// A pose in AI2-THOR's convention.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PoseRecord {
    /// Position of the middle of the body.
    pub position_m: Vec3,
    /// Heading.
    pub yaw_deg: f64,
    /// Pitch, positive looking down.
    pub horizon_deg: f64,
}

/// The generation state S.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StateRecord {
    /// Ids of the rooms on the reference trajectory, in house order.
    pub visited_room_ids: Vec<String>,
    /// Id of the room that changed at each of the last two transitions.
    pub changed_room_ids: Vec<Option<String>>,
    /// Ids of the goal rooms of the last two stages.
    pub goal_room_ids: Vec<String>,
    /// Id of the room in which the reference trajectory ends.
    pub transition_room_id: Option<String>,
}

/// A rejected goal.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RejectionRecord {
    /// Object.
    pub id: String,
    /// Reason for the rejection.
    pub reason: GoalRejection,
}

/// Reasons why an object cannot be a goal.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum GoalRejection {
    /// No reachable position of its room is at the reference distance.
    NoReferencePose,
    /// The object is not visible from any such position.
    NotVisible,
    /// No path leads to the position.
    Unreachable,
}
