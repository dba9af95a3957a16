//! A house instantiated: bodies in the world frame, navigation, layouts of objects, and inspection.

pub mod appearance;
pub mod footprint;
pub mod inspection;
pub mod layout;
pub mod mesh;
pub mod navigation;
pub mod outlines;
pub mod scene;
pub mod skin;
