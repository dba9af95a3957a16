//! Bodies of a house in the world frame.

mod bodies;
mod openings;
mod resting;
mod structure;

pub use bodies::{Body, BodyKind, OrientedBox, Scene};
pub(crate) use openings::door_shape;
