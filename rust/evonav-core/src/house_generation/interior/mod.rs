//! Furniture: where it can stand, and which piece stands there.

mod anchor;
mod choice;
mod free_floor;
mod furnish;
mod group;
mod piece;
mod stock;

pub(super) use free_floor::FreeFloor;
pub(super) use furnish::{furnish, sample_openness};
pub(super) use piece::{Piece, PlacedObject};
pub(super) use stock::Stock;
