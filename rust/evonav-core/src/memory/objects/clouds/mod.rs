//! Point clouds: thin them, find their clusters, and find the points near others.

mod block_grid;
mod blocks;
mod cells;
pub mod cloud;
pub mod dbscan;
pub(super) mod density;
pub(super) mod largest_cluster;
mod overlap;
pub(super) mod point_blocks;
pub mod voxel_filter;
pub mod voxels;
