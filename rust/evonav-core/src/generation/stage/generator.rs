//! The context that all draws of a task share.

use std::cell::RefCell;

use crate::{
    assets::Catalogue,
    generation::{Overrides, Parameters},
    rng::Stream,
    sensors::raster::FrameBuffer,
};

/// The context that all draws of a task share.
pub(crate) struct Generator<'a> {
    pub(crate) catalogue: &'a Catalogue,
    pub(crate) seed: u64,
    pub(crate) label: &'a str,
    pub(crate) parameters: &'a Parameters,
    /// Values that replace draws.
    pub(crate) overrides: &'a Overrides,
    /// Working memory of the renderer.
    pub(crate) frame: RefCell<FrameBuffer>,
    /// The stage during which the house changes; `None` for all other draws.
    pub(crate) during: Option<During<'a>>,
}

/// A stage during which the house changes.
#[derive(Clone, Copy)]
pub(crate) struct During<'a> {
    /// Id of the stage's target, which stays in the house.
    pub(crate) target_id: &'a str,
    /// Index of the room in which it was at the start.
    pub(crate) target_room: usize,
}

impl Generator<'_> {
    /// Return the random stream of one draw.
    pub(crate) fn stream(&self, stage: usize, what: &str) -> Stream {
        let stage = format!("stage {stage}");
        match self.during {
            None => Stream::new(self.seed, &[self.label, &stage, what]),
            Some(_) => Stream::new(self.seed, &[self.label, &stage, "during", what]),
        }
    }
}
