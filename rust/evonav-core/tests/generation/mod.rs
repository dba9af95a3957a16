//! Task generation.

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
