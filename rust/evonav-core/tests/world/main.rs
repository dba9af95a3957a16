//! Bodies of a house, navigation, layouts and inspection.

#[allow(dead_code, reason = "other test crates use the rest")]
#[path = "../common/recorded.rs"]
mod recorded;
#[allow(dead_code, reason = "other test crates use the rest")]
#[path = "../common/scenes.rs"]
mod scenes;
#[allow(dead_code, reason = "other test crates use the rest")]
#[path = "../common/solids.rs"]
mod solids;

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
