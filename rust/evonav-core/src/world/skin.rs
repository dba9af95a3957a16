//! Lay materials on the faces of a scene: give each face a texture and coordinates on it.

use crate::{
    assets::{
        material::{Layout, Material},
        part::{Part, Primitive},
    },
    geometry::{Vec3, rotate, transposed},
};

/// Cosine of the angle between a frustum's axis and the normals of its ends, at least.
const END: f64 = 0.999_999;
/// Part of a texture by which each part of a body is shifted against the one before, so that
/// boards differ.
const SHIFT: [f64; 2] = [0.381_966, 0.236_068];

/// The material of a face, and the texture's coordinates on it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Skin {
    /// Material.
    pub material: Material,
    /// Change of the texture's coordinates `[u, v]` a metre along the world's axes, in repeats of
    /// the texture. Zeros where the face has no texture.
    pub axes: [[f32; 3]; 2],
    /// Coordinates at the world's origin.
    pub origin: [f32; 2],
}

impl Skin {
    const fn plain(material: Material) -> Self {
        Self { material, axes: [[0.0; 3]; 2], origin: [0.0; 2] }
    }

    /// Return whether the face has no texture.
    pub fn is_plain(&self) -> bool {
        self.axes[0] == [0.0; 3]
    }

    /// Return the texture's coordinates at a point, in repeats of the texture; v is downwards.
    pub fn coordinates(&self, point_m: Vec3) -> [f32; 2] {
        std::array::from_fn(|i| {
            let [x, y, z] = self.axes[i].map(f64::from);
            (x * point_m[0] + y * point_m[1] + z * point_m[2] + f64::from(self.origin[i])) as f32
        })
    }
}

/// Lays the material of one part on its faces.
pub(super) struct Tailor<'a> {
    part: &'a Part,
    /// Whether textures continue from part to part, as on floors and walls.
    is_structure: bool,
    /// Number of the part in its body.
    index: usize,
}

impl<'a> Tailor<'a> {
    pub(super) fn new(part: &'a Part, is_structure: bool, index: usize) -> Self {
        Self { part, is_structure, index }
    }

    /// Return the skin of a face, given its normal in the world frame and its number in the part.
    pub(super) fn skin(&self, normal: Vec3, number: usize) -> Skin {
        let material = self.part.material;
        let layout = material.kind.layout();
        if layout == Layout::Plain {
            return Skin::plain(material);
        }
        let own = rotate(&transposed(&self.part.rotation), normal);
        match self.part.primitive {
            Primitive::Cuboid { half_m } | Primitive::Pad { half_m, .. } => {
                self.flat(layout, own, half_m)
            }
            Primitive::Frustum { bottom_m, top_m, half_height_m, sides } => {
                let half_m = [bottom_m[0].max(top_m[0]), half_height_m, bottom_m[1].max(top_m[1])];
                if own[1].abs() > END {
                    return self.flat(layout, own, half_m);
                }
                self.curved(layout, own, half_m, number, usize::from(sides.max(3)))
            }
            Primitive::Ellipsoid { half_m } => self.curved(layout, own, half_m, number, 12),
        }
    }

    /// Return the skin of a face across an axis of the part. Pictures are upright and not mirrored
    /// seen from outside; on horizontal faces their lower edge is in front (+z).
    fn flat(&self, layout: Layout, own: Vec3, half_m: Vec3) -> Skin {
        let axis = longest(own.map(f64::abs));
        let sign = own[axis].signum();
        // Own axes to the right and down, seen from outside.
        let (right, down) = match axis {
            0 => ([0.0, 0.0, sign], [0.0, -1.0, 0.0]),
            1 => ([-sign, 0.0, 0.0], [0.0, 0.0, 1.0]),
            _ => ([-sign, 0.0, 0.0], [0.0, -1.0, 0.0]),
        };
        let reach = |direction: Vec3| 2.0 * longest_of(direction, half_m);
        match layout {
            Layout::Plain => Skin::plain(self.part.material),
            Layout::Broad | Layout::Strip(_) if half_m.iter().any(|&half| half < half_m[axis]) => {
                Skin::plain(self.part.material)
            }
            Layout::Every | Layout::Broad | Layout::Strip(_) => {
                let [top, bottom] =
                    if let Layout::Strip(ends) = layout { ends } else { [0.0, 1.0] };
                let size_m = [reach(right), reach(down) / (bottom - top)];
                self.about_centre([right, down], size_m, [0.5, 0.5 * (top + bottom)])
            }
            Layout::Repeated(period_m) if self.is_structure => {
                let turned = |d: Vec3| rotate(&self.part.rotation, d);
                let axes = if axis == 1 {
                    [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
                } else {
                    [turned([1.0, 0.0, 0.0]), [0.0, -1.0, 0.0]]
                };
                self.scaled(axes, period_m, [0.0; 2])
            }
            Layout::Repeated(period_m) => {
                // The grain runs along the longer side.
                let axes = if reach(right) >= reach(down) { [right, down] } else { [down, right] };
                self.about_centre(axes, period_m, self.shift())
            }
        }
    }

    /// Return the skin of a face around the part's own y axis.
    fn curved(&self, layout: Layout, own: Vec3, half_m: Vec3, number: usize, sides: usize) -> Skin {
        let Layout::Repeated(period_m) = layout else {
            return Skin::plain(self.part.material);
        };
        let length = (own[0] * own[0] + own[2] * own[2]).sqrt().max(1e-9);
        let around = [own[2] / length, 0.0, -own[0] / length];
        // Perpendicular to the normal and to the direction around.
        let down = [own[0] * own[1] / length, -length, own[2] * own[1] / length];
        let chord_m = (half_m[0] + half_m[2]) * std::f64::consts::PI / sides as f64;
        let turn_m = (number % sides) as f64 * chord_m;
        let [first, second] = self.shift();
        if half_m[1] > half_m[0].max(half_m[2]) {
            // Poles: the grain runs along them.
            let shift = [first, second + turn_m / period_m[1]];
            return self.about_centre([down, around], period_m, shift);
        }
        self.about_centre([around, down], period_m, [first + turn_m / period_m[0], second])
    }

    fn shift(&self) -> [f64; 2] {
        SHIFT.map(|shift| (shift * self.index as f64).fract())
    }

    /// Return the skin whose coordinates grow by 1 each `period_m` along own directions, and are
    /// `at_centre` at the part's centre.
    fn about_centre(&self, own: [Vec3; 2], period_m: [f64; 2], at_centre: [f64; 2]) -> Skin {
        let axes = own.map(|direction| rotate(&self.part.rotation, direction));
        let origin: [f64; 2] = std::array::from_fn(|i| {
            let at_m: f64 = axes[i].iter().zip(self.part.centre_m).map(|(a, c)| a * c).sum();
            at_centre[i] - at_m / period_m[i]
        });
        self.scaled(axes, period_m, origin)
    }

    fn scaled(&self, axes: [Vec3; 2], period_m: [f64; 2], origin: [f64; 2]) -> Skin {
        Skin {
            material: self.part.material,
            axes: std::array::from_fn(|i| axes[i].map(|a| (a / period_m[i]) as f32)),
            origin: origin.map(|o| o as f32),
        }
    }
}

/// Return the index of the largest number.
fn longest(of: Vec3) -> usize {
    (1..3).fold(0, |best, i| if of[i] > of[best] { i } else { best })
}

/// Return the half length of a box along one of its axes.
fn longest_of(direction: Vec3, half_m: Vec3) -> f64 {
    (0..3).map(|i| direction[i].abs() * half_m[i]).fold(0.0, f64::max)
}
