//! The planes between which a view sees.

use crate::geometry::Vec3;

/// Near plane, far plane and the image's borders, and two planes more that everything is in front
/// of: eight numbers fill vectors.
#[derive(Default)]
pub(super) struct Frustum {
    /// Inward normals, by axis.
    normals: [[f64; 8]; 3],
    /// The smallest `normal . p` of points in view.
    least: [f64; 8],
}

impl Frustum {
    /// Set a plane; see [`Frustum`] for its index.
    pub fn set(&mut self, index: usize, normal: Vec3, least: f64) {
        for (normals, normal) in self.normals.iter_mut().zip(normal) {
            normals[index] = normal;
        }
        self.least[index] = least;
    }

    /// Return whether a part of a box may be in view.
    ///
    /// # Arguments
    /// * `centre_m` - its middle, relative to the camera.
    #[inline(always)]
    pub fn may_contain(&self, centre_m: Vec3, size_m: Vec3) -> bool {
        let Self { normals: [x, y, z], least } = self;
        let mut is_outside = 0;
        for i in 0..least.len() {
            let at = x[i] * centre_m[0] + y[i] * centre_m[1] + z[i] * centre_m[2];
            let reach = x[i].abs() * size_m[0] + y[i].abs() * size_m[1] + z[i].abs() * size_m[2];
            is_outside |= u64::from(at + 0.5 * reach < least[i]);
        }
        is_outside == 0
    }
}
