//! Frontiers: places at which the known floor ends and exploration can continue, by 3D-Mem's rules.

mod frontier;
mod frontier_set;
mod regions;
mod viewpoints;

pub use frontier::{Frontier, FrontierConfig};
pub use frontier_set::Frontiers;
