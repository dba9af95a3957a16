//! Perception between a rendered frame and an agent: simulated errors, and a small detector.

pub mod depth_noise;
pub mod false_detections;
pub mod mask_distortion;
mod mask_image;
pub mod mask_outlines;
pub mod mini;
