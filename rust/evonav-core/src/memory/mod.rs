//! The memory of an agent: an occupancy map with frontiers, object entries, and snapshots.

pub mod frontiers;
pub mod objects;
pub mod occupancy;
pub mod snapshots;
