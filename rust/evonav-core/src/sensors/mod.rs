//! Cameras and what they perceive: images, rays, visible cells and bodies, masks, points and PNG files.

pub mod camera;
pub mod instance_masks;
pub mod png;
pub mod raster;
pub mod ray_caster;
pub mod runs;
pub mod unproject;
pub mod visible_bodies;
pub mod visible_cells;
