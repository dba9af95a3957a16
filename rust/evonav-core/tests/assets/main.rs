//! The asset catalogue and the shapes drawn for assets.

#[allow(dead_code, reason = "other test crates use the rest")]
#[path = "../common/recorded.rs"]
mod recorded;
#[allow(dead_code, reason = "other test crates use the rest")]
#[path = "../common/solids.rs"]
mod solids;

mod catalogue;
mod materials;
mod shapes;
mod shapes_open;
