//! Task generation: which room evolves, what moves where, and which object is the goal
//! (paper, Sec. 3.2 and A.1-A.4).

mod goals;
mod parameters;
mod rooms;

pub use goals::{Candidate, GoalBias, goal_room_weights, sample_goal, target_scores};
pub use parameters::Parameters;
pub use rooms::{Mode, RoomHistory, evolved_room_weight, sample_evolved_room};
