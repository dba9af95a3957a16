//! Cameras and what they perceive: images, rays, visible cells and bodies, masks and points.

pub mod camera;
pub mod instance_masks;
pub mod raster;
pub mod ray_caster;
pub mod unproject;
pub mod visible_bodies;
pub mod visible_cells;
