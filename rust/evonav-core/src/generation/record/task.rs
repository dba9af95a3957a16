//! A generated task and its stages.

use serde::Serialize;

use crate::{
    generation::record::{Appearance, EvolutionRecord, Relations, TargetRecord},
    geometry::{Vec2, Vec3},
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
