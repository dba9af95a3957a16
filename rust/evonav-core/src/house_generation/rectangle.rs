//! Upright rectangles on the ground plane.

use crate::geometry::Vec2;

/// A rectangle `[x, z]` with edges along the axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Rectangle {
    pub low_m: Vec2,
    pub high_m: Vec2,
}

impl Rectangle {
    /// Return the rectangle around two points.
    pub fn around(a: Vec2, b: Vec2) -> Self {
        let pick = |least: fn(f64, f64) -> f64| [least(a[0], b[0]), least(a[1], b[1])];
        Self { low_m: pick(f64::min), high_m: pick(f64::max) }
    }

    /// Return the edge lengths.
    pub fn size_m(&self) -> Vec2 {
        [0, 1].map(|i| self.high_m[i] - self.low_m[i])
    }

    /// Return the middle.
    pub fn centre_m(&self) -> Vec2 {
        [0, 1].map(|i| 0.5 * (self.low_m[i] + self.high_m[i]))
    }

    /// Return the area.
    pub fn area_m2(&self) -> f64 {
        let [x, z] = self.size_m();
        x * z
    }

    /// Return the rectangle with lengths added at its low and high ends.
    pub fn grown(&self, low_m: Vec2, high_m: Vec2) -> Self {
        Self {
            low_m: [0, 1].map(|i| self.low_m[i] - low_m[i]),
            high_m: [0, 1].map(|i| self.high_m[i] + high_m[i]),
        }
    }

    /// Return whether two rectangles share more than a border.
    pub fn overlaps(&self, other: &Self) -> bool {
        (0..2).all(|i| self.low_m[i] < other.high_m[i] && other.low_m[i] < self.high_m[i])
    }

    /// Return whether a point is inside.
    pub fn contains(&self, point_m: Vec2) -> bool {
        (0..2).all(|i| self.low_m[i] < point_m[i] && point_m[i] < self.high_m[i])
    }
}
