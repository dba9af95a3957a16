//! UniGoal's map and path planning.

mod bev_map;
mod fast_marching;
