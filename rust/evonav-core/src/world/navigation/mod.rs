//! Navigation: obstacles, the free space of an agent, and shortest paths.

mod agent_body;
mod distance_field;
mod distance_tiles;
mod free_space;
mod nodes;
pub(crate) mod obstacle;
mod obstacles;
mod tangents;
mod visibility_graph;

pub use agent_body::AgentBody;
pub use distance_field::DistanceField;
pub use free_space::{Navigation, NavigationConfig, map_spec};
pub use obstacle::Obstacle;
pub use obstacles::Obstacles;
pub use visibility_graph::{VisibilityGraph, path_length_m};
