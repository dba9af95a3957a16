//! One house, instantiated: what an agent can see and where it can go.

pub mod actions;
pub mod batch;
pub mod batch_slot;
mod embedded;
pub mod geodesic_field;

pub use embedded::{EmbeddedSimulator, SimulatorConfig};
