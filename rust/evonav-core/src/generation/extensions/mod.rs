//! What goes beyond the paper: things that come and go, doors and furniture that open and close,
//! lights, and days of people.

mod activities;
mod clearance;
mod conditions;
mod objects;
mod processes;
pub mod schedule;
pub mod transition;
