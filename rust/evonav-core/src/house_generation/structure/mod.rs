//! The structure of a house: its outline, its rooms on a grid, and the borders between them.

mod borders;
mod boundary;
mod floor_plan;

pub(super) use borders::{PlannedRoom, Side, Structure};
