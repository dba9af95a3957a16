//! What an agent remembers: an occupancy map with frontiers, and object entries.

mod cleaning;
pub mod cloud;
pub mod dbscan;
pub mod entry;
pub mod frontiers;
pub mod object_config;
pub mod objects;
pub mod occupancy;
mod regions;
pub mod sight_lines;
pub mod snapshots;
mod viewpoints;
pub mod voxels;
