//! Every parameter of house generation, in one record.

mod check;
mod record;
mod room_spec;

pub use record::{
    Appearance, Doors, FloorObjects, HouseParameters, Hung, SmallObjects, Structure, TimeOfDay,
};
pub use room_spec::{RoomNode, RoomSpec};
