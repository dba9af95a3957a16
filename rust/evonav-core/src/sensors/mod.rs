//! What a camera at a pose perceives.

pub mod camera;
pub mod ground_truth;
pub mod raster;
pub mod raster_count;
mod raster_fill;
mod raster_shade;
pub mod raycast;
pub mod raycast3d;
pub mod unproject;
pub mod visibility;
