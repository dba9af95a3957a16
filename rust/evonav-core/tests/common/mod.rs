//! Houses, scenes and geometry that tests of several modules use.

pub mod points;
pub mod recorded;
pub mod scenes;
pub mod solids;
