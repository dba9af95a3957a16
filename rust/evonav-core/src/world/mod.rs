//! A house instantiated: bodies in the world frame, collision, navigation.

pub mod mesh;
pub mod scene;
