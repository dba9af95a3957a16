//! Object entries: an agent's memory of the objects that it detected.

mod cleaning;
pub mod cloud;
mod config;
pub mod dbscan;
pub mod depth_evidence;
mod entry;
mod object_map;
mod point_blocks;
pub mod seen_through;
pub mod sight_lines;
mod size;
mod visibility;
pub mod voxel_filter;
pub mod voxels;

pub use config::ObjectMapConfig;
pub use entry::Entry;
pub use object_map::{Comparison, DetectedView, ObjectMap, Update};
