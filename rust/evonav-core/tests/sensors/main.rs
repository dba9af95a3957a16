//! Images and what is visible in them.

#[allow(dead_code, reason = "other test crates use the rest")]
#[path = "../common/scenes.rs"]
mod scenes;

mod flat;
mod images;
mod light;
mod lit;
mod png;
mod raster;
mod shading;
mod textures;
mod tracer;
mod visible_bodies;
mod visible_px;
