//! A house instantiated: bodies in the world frame, collision, navigation, and where things can stand.

pub mod footprint;
pub mod inspection;
pub mod layout;
pub mod mesh;
pub mod navigation;
pub mod scene;
