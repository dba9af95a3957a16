//! Random looks of a house: other materials, other colours, another light.
//!
//! Only what is seen changes. Shapes, depth, instances and navigation stay as they are.

mod change;
mod colours;
mod lighting;
mod materials;
mod subject;
mod varied_scene;

pub use change::{Appearance, Change, Lighting, Surfaces};
pub(crate) use varied_scene::scene_of;
