//! Bodies of a house, navigation, layouts and inspection.

mod footprint;
mod inspection;
mod navigation;
mod navigation_recorded;
mod navigation_reference;
mod object_outlines;
mod outlines;
mod random_spawn;
mod scene;
mod scene_recorded;
