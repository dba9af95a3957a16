//! UniGoal's map and path planning.

mod bev_map;
mod bev_scenes;
mod fast_marching;
