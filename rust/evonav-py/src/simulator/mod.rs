//! Bindings of `evonav_core::simulator`.

pub mod batch;
pub mod embedded;
