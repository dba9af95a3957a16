//! A house instantiated: bodies in the world frame, collision, navigation.

pub mod collision;
pub mod footprint;
pub mod inspect;
pub mod mesh;
pub mod navigation;
mod openings;
pub mod paths;
pub mod scene;
mod settle;
mod solid;
mod structure;
mod tangents;
