//! Images and what is visible in them.

mod raster;
mod visible_bodies;
mod visible_px;
