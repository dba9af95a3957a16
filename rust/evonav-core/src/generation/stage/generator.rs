//! What all draws of a task share.

use std::cell::RefCell;

use crate::{
    assets::Catalogue,
    generation::{Given, Parameters},
    rng::Stream,
    sensors::raster::FrameBuffer,
};

/// What all draws of a task share.
pub(crate) struct Generator<'a> {
    pub(crate) catalogue: &'a Catalogue,
    pub(crate) seed: u64,
    pub(crate) label: &'a str,
    pub(crate) parameters: &'a Parameters,
    /// What is not drawn.
    pub(crate) given: &'a Given,
    /// Working memory of the renderer.
    pub(crate) frame: RefCell<FrameBuffer>,
}

impl Generator<'_> {
    /// The random stream of one draw.
    pub(crate) fn stream(&self, stage: usize, what: &str) -> Stream {
        Stream::new(self.seed, &[self.label, &format!("stage {stage}"), what])
    }
}
