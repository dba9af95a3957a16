//! The parts of an asset.

use crate::{
    assets::part::Part,
    geometry::{Mat3, Vec3},
};

/// An asset's parts, in the object frame.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Shape {
    /// The solid parts. Depth, instances, collision and navigation know only them.
    pub parts: Vec<Part>,
    /// Parts that only colours show: what makes an object look like itself and is too small or too
    /// soft to bump into. They lie in the box of the solid parts.
    pub trim: Vec<Part>,
}

impl Shape {
    /// Exchange parts and trim.
    pub(super) fn swap(&mut self) {
        std::mem::swap(&mut self.parts, &mut self.trim);
    }

    /// Place the shape in the world.
    #[must_use]
    pub fn placed(&self, origin_m: Vec3, rotation: &Mat3) -> Self {
        let place = |parts: &[Part]| parts.iter().map(|p| p.placed(origin_m, rotation)).collect();
        Self { parts: place(&self.parts), trim: place(&self.trim) }
    }
}
