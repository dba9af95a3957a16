//! Make houses in ProcTHOR's way (Deitke et al., "ProcTHOR: Large-Scale Embodied AI Using
//! Procedural Generation", NeurIPS 2022): [`HouseMaker`] makes the house of a seed and a number.
//!
//! The steps are those of the package `procthor` 0.0.1.dev2 (Allen Institute for AI, Apache-2.0),
//! from which the parameters are taken; the code is our own. A room spec is drawn, its rooms grow
//! on a grid (`structure`), doors connect them (`doors`), furniture is placed in free rectangles of
//! the floor (`interior`), windows, televisions and paintings on free walls (`hanging`), and small
//! objects on furniture (`small_objects`). A house that fails the checks (`acceptance`) is drawn again.

mod acceptance;
mod appearance;
mod document;
mod doors;
mod hanging;
mod interior;
mod maker;
mod objects;
mod parameters;
mod rectangle;
mod sampling;
mod small_objects;
mod structure;

pub use maker::HouseMaker;
pub use parameters::{
    Appearance, Doors, FloorObjects, HouseParameters, Hung, RoomNode, RoomSpec, SmallObjects,
    Structure, TimeOfDay,
};
