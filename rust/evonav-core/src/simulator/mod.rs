//! The simulator: one house in which agents see and move, and batches of agents.

pub mod actions;
pub mod batch;
pub mod batch_slot;
mod change_around;
mod embedded;
pub mod geodesic_field;

pub use embedded::{EmbeddedSimulator, SimulatorConfig};
