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
}

impl Generator<'_> {
    /// Return the random stream of one draw.
    pub(crate) fn stream(&self, stage: usize, what: &str) -> Stream {
        Stream::new(self.seed, &[self.label, &format!("stage {stage}"), what])
    }
}
