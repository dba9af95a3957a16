//! Houses, simulator, mapping and evolution of evonav, in pure Rust.
//!
//! One way through: [`house`] -> [`assets`] -> [`world`] -> [`sensors`] -> [`memory`] -> [`unigoal`],
//! with [`generation`] beside it. Metres and radians; AI2-THOR's frame (left-handed, y up, yaw
//! clockwise from +z seen from above).

pub mod assets;
pub mod error;
pub mod generation;
pub mod geometry;
pub mod grid;
pub mod house;
pub mod memory;
pub mod perception;
pub mod rng;
pub mod sensors;
pub mod simulator;
pub mod unigoal;
pub mod world;

pub use error::Error;
