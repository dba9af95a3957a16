//! Bindings of `evonav_core::perception`.

pub mod mini;
pub mod noise;
