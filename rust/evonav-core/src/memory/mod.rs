//! What an agent remembers: an occupancy map with frontiers, and object entries.

pub mod bits;
pub mod components;
pub mod frontiers;
pub mod occupancy;
