//! Task generation (paper, Sec. 3.2 and A.1-A.4): sample the room that evolves, the moves in it,
//! and the goal of each stage.

mod algorithm;
mod extension_parameters;
mod extensions;
mod mode;
mod overrides;
mod parameters;
mod placement;
pub mod record;
mod stage;
mod task;

pub use algorithm::{
    evolved_room::{evolved_room_weight, sample_evolved_room},
    goal::{Candidate, GoalBias, goal_room_weights, sample_goal, target_scores},
};
pub use extension_parameters::{DuringStage, Extensions, Occurrence, Schedule};
pub use mode::Mode;
pub use overrides::{Overrides, StageOverrides};
pub use parameters::Parameters;
pub use placement::asset_groups::{AssetGroup, asset_groups};
pub use record::RoomHistory;
pub use task::{Generation, generate_task};
