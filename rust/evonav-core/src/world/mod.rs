//! A house instantiated: bodies in the world frame, collision, navigation.

pub mod scene;
