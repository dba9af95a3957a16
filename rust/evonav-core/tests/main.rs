//! All tests of the core from outside, in one program, which is linked once.

#![allow(clippy::unwrap_used, reason = "clippy.toml allows it in tests, but not in their helpers")]

mod assets;
mod common;
mod drawing;
mod fuzzing;
mod generation;
mod house;
mod house_generation;
mod memory;
mod perception;
mod sensors;
mod simulator;
mod unigoal;
mod world;
