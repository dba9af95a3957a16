//! What the agent's sensors see.

pub mod camera;
pub mod raster;
mod raster_fill;
mod raster_shade;
pub mod raycast3d;
