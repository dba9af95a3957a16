//! Task generation.

#![allow(clippy::unwrap_used, reason = "clippy.toml allows it in tests, but not in their helpers")]

#[allow(dead_code, reason = "other test crates use the rest")]
#[path = "../common/points.rs"]
mod points;
#[allow(dead_code, reason = "other test crates use the rest")]
#[path = "../common/recorded.rs"]
mod recorded;
#[allow(dead_code, reason = "other test crates use the rest")]
#[path = "../common/solids.rs"]
mod solids;

mod asset_groups;
mod extensions;
mod failures;
mod houses;
mod overrides;
mod refusals;
mod relations;
mod sampling;
mod schema;
mod start;
mod task;
mod tasks;
