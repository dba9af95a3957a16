//! The records of generation: the JSON that Python's `evonav.tasks.oracle` reads.

mod during;
mod evolution;
mod target;
mod task;

pub use during::DuringRecord;
pub use evolution::{
    ActivityRecord, ChangeRecord, EvolutionOutcome, EvolutionRecord, ModificationFailure,
    ObjectRecord, RoomHistory, RoomWeightRecord, StateChangeRecord,
};
pub use target::{Anchor, Appearance, Determiner, Relations, TargetRecord, Tint};
pub use task::{
    GeneratedStage, GeneratedTask, GoalRejection, PoseRecord, RejectReason, Rejected,
    RejectionRecord, StateRecord,
};
