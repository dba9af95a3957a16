//! The parts of one stage: its world, the generation state, and the description of its target.

pub mod appearance;
pub mod changes;
pub mod generation_state;
pub mod generator;
pub mod relations;
pub mod stage_world;
