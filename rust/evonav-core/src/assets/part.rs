//! Convex primitives: what every body in the world is made of.

use crate::geometry::{Mat3, Vec3};

/// A convex solid about its own origin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Primitive {
    /// A cuboid.
    Cuboid {
        /// Half edge lengths.
        half_m: Vec3,
    },
    /// A prism, cylinder, cone or frustum about y over regular `sides`-gons stretched to ellipses.
    Frustum {
        /// Half axes `[x, z]` of the lower face.
        bottom_m: [f64; 2],
        /// Half axes `[x, z]` of the upper face.
        top_m: [f64; 2],
        /// Half the height.
        half_height_m: f64,
        /// Number of sides, at least 3.
        sides: u8,
    },
    /// An ellipsoid.
    Ellipsoid {
        /// Half axes.
        half_m: Vec3,
    },
}

/// A primitive in the frame of the body that owns it (object frame: origin at the box's centre).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Part {
    /// The solid.
    pub primitive: Primitive,
    /// Its origin.
    pub centre_m: Vec3,
    /// Its rotation.
    pub rotation: Mat3,
    /// Surface colour, sRGB.
    pub colour: [u8; 3],
}
