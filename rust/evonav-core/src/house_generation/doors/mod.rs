//! Doors and open borders: which rooms are connected, where, and by what.

mod connections;
mod placed_door;
mod sample;

pub(super) use placed_door::PlacedDoor;
pub(super) use sample::{Openings, sample_openings};
