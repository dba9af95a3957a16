//! A house instantiated: bodies in the world frame, collision, navigation.

pub mod collision;
pub mod footprint;
pub mod mesh;
pub mod navigation;
pub mod paths;
pub mod scene;
mod openings;
mod structure;
