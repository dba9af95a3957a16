//! Images and what is visible in them.

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
