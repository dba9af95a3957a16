//! Windows, and what hangs on walls.

mod pictures;
mod wall_space;
mod windows;

pub(super) use pictures::sample_hung;
pub(super) use windows::{PlacedWindow, sample_windows};
