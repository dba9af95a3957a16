//! UniGoal's geometry: a bird's-eye map fused from depth, exploration targets, path planning, and
//! cells blocked after collisions.

pub mod bev_config;
pub mod bev_map;
pub mod collision_strip;
pub mod depth_view;
pub mod exploration;
pub mod path_planning;
pub mod voxel_columns;
