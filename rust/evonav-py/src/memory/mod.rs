//! Bindings of `evonav_core::memory`.

pub mod objects;
pub mod occupancy;
pub mod snapshots;
