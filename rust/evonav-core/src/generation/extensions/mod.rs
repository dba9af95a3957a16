//! Extensions beyond the paper: objects that appear and vanish, doors and furniture that open and
//! close, lights, and people with daily schedules.

mod activities;
mod clearance;
mod conditions;
mod objects;
mod processes;
pub mod schedule;
pub mod transition;
