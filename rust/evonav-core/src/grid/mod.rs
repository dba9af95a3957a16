//! Regular grids on the ground plane, and operations on grids of bits.

pub mod bits;
pub mod components;
pub mod dilate;
pub mod fast_marching;
mod spec;

pub use spec::{GridSpec, MAX_CELLS};
