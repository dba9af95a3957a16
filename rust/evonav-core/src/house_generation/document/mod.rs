//! Write a house as ProcTHOR's JSON, schema 1.0.0.

mod layers;
mod lights;
mod write;

pub(super) use write::{Agent, Draft};
