//! The algorithms of evonav in pure Rust: houses, the simulator, mapping and task generation.
//!
//! Modules import each other in one direction: [`house`] -> [`assets`] -> [`world`] -> [`sensors`]
//! -> [`memory`], with [`simulator`], [`generation`], [`perception`] and [`unigoal`] on top;
//! [`textures`] belong to [`sensors`]; [`drawing`] and [`resampling`] serve reports.
//! Lengths are in metres and angles in radians, in AI2-THOR's frame: left-handed, y up, yaw
//! clockwise from +z seen from above.

pub mod assets;
pub mod drawing;
pub mod error;
pub mod generation;
pub mod geometry;
pub mod grid;
pub mod house;
pub mod house_generation;
pub mod memory;
pub mod perception;
pub mod resampling;
pub mod rng;
pub mod sensors;
pub mod simulator;
pub mod textures;
pub mod unigoal;
pub mod world;

pub use error::Error;
