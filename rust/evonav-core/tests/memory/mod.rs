//! Occupancy maps, object entries, depth evidence, forgetting, sight lines and snapshots.

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
