//! Convex primitives, of which every body in the world consists.

use crate::{
    assets::material::Material,
    geometry::{Aabb, Mat3, Vec3, add, compose, rotate},
};

/// A convex solid about its own origin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Primitive {
    /// A cuboid.
    Cuboid {
        /// Half edge lengths.
        half_m: Vec3,
    },
    /// A prism, cylinder, cone or frustum about y over regular `sides`-gons stretched to ellipses.
    ///
    /// The polygons are inscribed: corner `k` is at `2 pi k / sides` from +x towards +z
    /// ([`Primitive::ring_m`]), so with `sides` a multiple of 4 they touch the ellipse's box.
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
    /// A cuboid whose edges and corners are cut off, as those of cushions; only for trim.
    Pad {
        /// Half edge lengths of the cuboid.
        half_m: Vec3,
        /// Width of the cuts, at most the smallest half edge.
        cut_m: f64,
    },
}

impl Primitive {
    /// Return the corners of one face of a frustum, at height `y_m`, from +x towards +z.
    pub fn ring_m(half_axes_m: [f64; 2], y_m: f64, sides: u8) -> impl Iterator<Item = Vec3> {
        (0..sides).map(move |k| {
            let [x, z] = unit_corner(k, sides);
            [half_axes_m[0] * x, y_m, half_axes_m[1] * z]
        })
    }
}

/// Return the corner `k` of a regular polygon, exact where it lies on an axis.
fn unit_corner(k: u8, sides: u8) -> [f64; 2] {
    let (k, sides) = (u32::from(k), u32::from(sides.max(1)));
    if 4 * k % sides == 0 {
        return [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]][(4 * k / sides % 4) as usize];
    }
    let (sin, cos) = (std::f64::consts::TAU * f64::from(k) / f64::from(sides)).sin_cos();
    [cos, sin]
}

/// A primitive in the frame of the body that owns it (object frame: origin at the box's centre).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Part {
    /// The solid.
    pub primitive: Primitive,
    /// Origin of the solid.
    pub centre_m: Vec3,
    /// Rotation of the solid.
    pub rotation: Mat3,
    /// Surface colour, sRGB.
    pub colour: [u8; 3],
    /// Material of the surface.
    pub material: Material,
}

impl Part {
    /// Return the smallest box around the part, in the part's frame of reference.
    pub fn aabb(&self) -> Aabb {
        let row = |i: usize| self.rotation[i];
        let reach = match self.primitive {
            Primitive::Cuboid { half_m } | Primitive::Pad { half_m, .. } => {
                std::array::from_fn(|i| row(i).iter().zip(half_m).map(|(r, h)| (r * h).abs()).sum())
            }
            Primitive::Ellipsoid { half_m } => std::array::from_fn(|i| {
                row(i).iter().zip(half_m).map(|(r, h)| (r * h).powi(2)).sum::<f64>().sqrt()
            }),
            Primitive::Frustum { bottom_m, top_m, half_height_m, sides } => {
                let lower = Primitive::ring_m(bottom_m, -half_height_m, sides);
                let upper = Primitive::ring_m(top_m, half_height_m, sides);
                let place = |p| add(self.centre_m, rotate(&self.rotation, p));
                return Aabb::of_points(lower.chain(upper).map(place));
            }
        };
        let reach: Vec3 = reach;
        Aabb {
            min_m: std::array::from_fn(|i| self.centre_m[i] - reach[i]),
            max_m: std::array::from_fn(|i| self.centre_m[i] + reach[i]),
        }
    }

    /// Transform the part into a frame in which its own frame stands at `origin_m`, turned by
    /// `rotation`.
    #[must_use]
    pub fn placed(&self, origin_m: Vec3, rotation: &Mat3) -> Self {
        Self {
            centre_m: add(origin_m, rotate(rotation, self.centre_m)),
            rotation: compose(rotation, &self.rotation),
            ..*self
        }
    }
}

/// Return the smallest box around all `parts`; [`Aabb::EMPTY`] if there are none.
pub fn aabb_of(parts: &[Part]) -> Aabb {
    parts.iter().fold(Aabb::EMPTY, |bounds, part| bounds.union(part.aabb()))
}
