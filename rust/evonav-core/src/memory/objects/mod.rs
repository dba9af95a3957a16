//! Object entries: an agent's memory of the objects that it detected.

mod cleaning;
pub mod clouds;
mod config;
pub mod depth_evidence;
mod entry;
mod object_map;
pub mod seen_through;
pub mod sight_lines;
mod size;
mod visibility;

pub use config::ObjectMapConfig;
pub use entry::Entry;
pub use object_map::{Comparison, DetectedView, ObjectMap, Update};
