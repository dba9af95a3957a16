//! Occupancy maps, object entries, depth evidence, forgetting, sight lines and snapshots.

#![allow(clippy::unwrap_used, reason = "clippy.toml allows it in tests, but not in their helpers")]

mod depth_evidence;
mod distances;
mod forgetting;
mod masks;
mod objects;
mod occupancy;
mod points;
mod sight_lines;
mod snapshots;
mod viewpoints;
