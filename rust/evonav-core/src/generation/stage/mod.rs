//! What one stage of a task is made of.

pub mod appearance;
pub mod changes;
pub mod generation_state;
pub mod generator;
pub mod relations;
pub mod stage_world;
