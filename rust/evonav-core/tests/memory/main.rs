//! Occupancy maps, object entries, sight lines and snapshots.

mod objects;
mod occupancy;
mod sight_lines;
mod snapshots;
