//! Poses, rotations, boxes and planar polygons in AI2-THOR's frame.

pub mod outline;

use serde::{Deserialize, Serialize};

/// A point or a vector `[x, y, z]` in metres.
pub type Vec3 = [f64; 3];
/// A point on the ground plane, `[x, z]` in metres.
pub type Vec2 = [f64; 2];
/// A rotation, row-major: `world = rotation * local`.
pub type Mat3 = [[f64; 3]; 3];

/// No rotation.
pub const IDENTITY: Mat3 = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// Position and viewing direction of an agent.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// Position of the agent's body (AI2-THOR's agent position).
    pub position_m: Vec3,
    /// Heading: 0 along +z, growing towards +x.
    pub yaw_rad: f64,
    /// Camera pitch; positive looks down.
    pub horizon_rad: f64,
}

/// An axis-aligned box.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Aabb {
    /// Smallest corner.
    pub min_m: Vec3,
    /// Largest corner.
    pub max_m: Vec3,
}

impl Aabb {
    /// The box that contains nothing; extending it by a point gives that point.
    pub const EMPTY: Self = Self { min_m: [f64::INFINITY; 3], max_m: [f64::NEG_INFINITY; 3] };

    /// Return the smallest box around points.
    pub fn of_points(points_m: impl IntoIterator<Item = Vec3>) -> Self {
        points_m.into_iter().fold(Self::EMPTY, Self::extended)
    }

    /// Return this box grown to contain `point_m`.
    #[must_use]
    pub fn extended(mut self, point_m: Vec3) -> Self {
        for (axis, &value) in point_m.iter().enumerate() {
            self.min_m[axis] = self.min_m[axis].min(value);
            self.max_m[axis] = self.max_m[axis].max(value);
        }
        self
    }

    /// Return the smallest box around both.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        self.extended(other.min_m).extended(other.max_m)
    }

    /// Return whether the closed boxes share a point.
    pub fn intersects(&self, other: &Self) -> bool {
        (0..3).all(|i| self.min_m[i] <= other.max_m[i] && other.min_m[i] <= self.max_m[i])
    }

    /// Return the middle of the box.
    pub fn centre_m(&self) -> Vec3 {
        std::array::from_fn(|i| 0.5 * (self.min_m[i] + self.max_m[i]))
    }

    /// Return the edge lengths.
    pub fn size_m(&self) -> Vec3 {
        std::array::from_fn(|i| self.max_m[i] - self.min_m[i])
    }
}

/// Add two vectors.
#[inline]
pub fn add(a: Vec3, b: Vec3) -> Vec3 {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// Subtract `b` from `a`.
#[inline]
pub fn sub(a: Vec3, b: Vec3) -> Vec3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// Transpose a rotation, which inverts it.
pub fn transposed(matrix: &Mat3) -> Mat3 {
    std::array::from_fn(|i| std::array::from_fn(|j| matrix[j][i]))
}

/// Rotate a vector: `rotation * vector`.
#[inline]
pub fn rotate(rotation: &Mat3, vector: Vec3) -> Vec3 {
    let [x, y, z] = vector;
    let along = |row: &Vec3| row[0] * x + row[1] * y + row[2] * z;
    [along(&rotation[0]), along(&rotation[1]), along(&rotation[2])]
}

/// Compose two rotations: `a * b` applies `b` first, then `a`.
pub fn compose(a: &Mat3, b: &Mat3) -> Mat3 {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

/// Return the rotation about y by `yaw_rad`, clockwise seen from above: +z turns towards +x.
pub fn yaw_rotation(yaw_rad: f64) -> Mat3 {
    let (sin, cos) = yaw_rad.sin_cos();
    [[cos, 0.0, sin], [0.0, 1.0, 0.0], [-sin, 0.0, cos]]
}

/// Return the rotation of Unity's Euler angles, degrees `[x, y, z]`: about z first, then x, then y.
pub fn euler_rotation_deg(angles_deg: Vec3) -> Mat3 {
    let [x, y, z] = angles_deg.map(f64::to_radians);
    let (sin_x, cos_x) = x.sin_cos();
    let (sin_z, cos_z) = z.sin_cos();
    let about_x = [[1.0, 0.0, 0.0], [0.0, cos_x, -sin_x], [0.0, sin_x, cos_x]];
    let about_z = [[cos_z, -sin_z, 0.0], [sin_z, cos_z, 0.0], [0.0, 0.0, 1.0]];
    compose(&yaw_rotation(y), &compose(&about_x, &about_z))
}

/// Return the ground-plane distance between `[x, z]` points.
pub fn distance_2d_m(a_m: Vec2, b_m: Vec2) -> f64 {
    (a_m[0] - b_m[0]).hypot(a_m[1] - b_m[1])
}

/// Return the smallest and largest corner of the box around points of the ground plane; infinite and
/// reversed for no points.
pub fn bounds_2d_m(points_m: impl IntoIterator<Item = Vec2>) -> [Vec2; 2] {
    let empty = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
    points_m.into_iter().fold(empty, |[low, high], point| {
        [[0, 1].map(|i| low[i].min(point[i])), [0, 1].map(|i| high[i].max(point[i]))]
    })
}

/// Return the signed area of a polygon in the x-z plane (positive when x turns towards z).
pub fn polygon_area_m2(polygon_m: &[Vec2]) -> f64 {
    let next = polygon_m.iter().cycle().skip(1);
    0.5 * polygon_m.iter().zip(next).map(|(a, b)| a[0] * b[1] - b[0] * a[1]).sum::<f64>()
}

/// Return whether `point_m` lies in the polygon (even-odd rule; the border may fall either way).
pub fn polygon_contains(polygon_m: &[Vec2], point_m: Vec2) -> bool {
    let mut is_inside = false;
    let next = polygon_m.iter().cycle().skip(1);
    for (a, b) in polygon_m.iter().zip(next) {
        if (a[1] > point_m[1]) != (b[1] > point_m[1]) {
            let x = a[0] + (point_m[1] - a[1]) / (b[1] - a[1]) * (b[0] - a[0]);
            is_inside ^= point_m[0] < x;
        }
    }
    is_inside
}
