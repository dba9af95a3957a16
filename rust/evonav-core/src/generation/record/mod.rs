//! The records of generation: the JSON that Python's `evonav.tasks.oracle` reads.

mod delta;
mod evolution;
mod target;
mod task;

pub use evolution::{
    ActivityRecord, ChangeRecord, EvolutionOutcome, EvolutionRecord, ModificationFailure,
    ObjectRecord, RoomHistory, RoomWeightRecord, StateChangeRecord,
};
pub use target::{Anchor, Appearance, Determiner, Relations, TargetRecord, Tint};
pub use task::{
    DuringRecord, GeneratedStage, GeneratedTask, GoalRejection, PoseRecord, RejectReason, Rejected,
    RejectionRecord, StateRecord,
};
