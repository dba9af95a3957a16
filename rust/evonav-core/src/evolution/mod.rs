//! Task generation: which room evolves, what moves where, and which object is the goal
//! (paper, Sec. 3.2 and A.1-A.4).

mod activities;
mod appearance;
mod beyond;
mod evolve;
mod extensions;
mod generate;
mod given;
mod goals;
mod groups;
mod layout;
mod modify;
mod parameters;
mod placement;
mod reach;
pub mod record;
mod relations;
mod reserve;
mod rooms;
mod schedule;
mod settle;
mod spawn;
mod stage;
mod state;
mod states;
mod surfaces;
mod target;
mod unit;

pub use extensions::{Extensions, Occurrence, Schedule};
pub use generate::{Generation, generate_given, generate_task};
pub use given::{Given, GivenStage};
pub use goals::{Candidate, GoalBias, goal_room_weights, sample_goal, target_scores};
pub use groups::{Group, asset_groups};
pub use parameters::Parameters;
pub use rooms::{Mode, RoomHistory, evolved_room_weight, sample_evolved_room};
pub use settle::settled;
pub use spawn::{SpawnRequest, Spawned, random_spawn};
