//! Placement of furniture in a room: groups, free places, and what must stay reachable.

pub mod asset_groups;
pub mod movable_group;
pub mod place_search;
pub mod reach;
pub mod room_outline;
pub mod step_grid;
