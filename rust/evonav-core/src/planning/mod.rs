//! UniGoal's geometry: a bird's-eye map fused from depth, distances by fast marching, exploration
//! targets, short-term goals and what collisions teach.

pub mod bev;
pub mod collision;
pub mod explore;
pub mod fmm;
pub mod short_term;
pub mod splat;
