//! The steps of Algorithm 1 (paper, Sec. 3.2 and A.1).

pub mod during_stage;
pub mod evolved_room;
pub mod goal;
pub mod room_modification;
pub mod scene_evolution;
pub mod stage_task;
