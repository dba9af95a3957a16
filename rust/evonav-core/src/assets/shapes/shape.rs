//! The parts of an asset and the words for them.

use serde::Serialize;

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

/// Traits by which a drawn shape can be described.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct ShapeTraits {
    /// Form: `round`, `L-shaped` or `U-shaped`, if its category has other forms too.
    pub form: Option<&'static str>,
    /// Parts by which it can be recognised, the most striking first.
    pub details: Vec<Detail>,
}

/// A part that has a common name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Detail {
    /// Name in the singular, with adjectives, for example `open shelf`.
    pub noun: &'static str,
    /// Number of such parts.
    pub count: usize,
}
