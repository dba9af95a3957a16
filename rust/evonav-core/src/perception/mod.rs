//! What stands between a rendered frame and an agent: simulated errors, and a small detector.

pub mod depth_noise;
pub mod mask_noise;
pub mod mini;
