//! Layouts: the objects of a house while they are moved about, where they can stand and where they
//! come to rest.

pub(crate) mod contact;
pub(crate) mod free_floor;
mod gravity;
mod house_layout;
mod item;
mod random_spawn;
pub(crate) mod rounding;
pub(crate) mod surfaces;

pub use gravity::settled;
pub use house_layout::Layout;
pub use item::{Item, PlacedItem, Placement};
pub use random_spawn::{SpawnRequest, Spawned, random_spawn};
