//! ProcTHOR houses (schemas 0.0.1 and 1.0.0): a lossless document and a checked, typed view of it.

mod delta;
mod document;
mod lights;
mod node;
mod parse;
mod read;
mod schema;
mod validate;

pub use delta::{AddedObject, HouseDelta, ObjectMove, StateChange};
pub use lights::Lamp;
pub use schema::{
    Condition, EXTERIOR, House, Object, Opening, OwnAsset, Room, Start, Surface, Wall,
};
