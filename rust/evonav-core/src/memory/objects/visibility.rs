//! Entries whose places an image may show.

use crate::{
    Error,
    geometry::{Aabb, Mat3, Vec3, distance_2d_m, rotate, sub, transposed},
    memory::objects::ObjectMap,
    sensors::camera::Camera,
};

impl ObjectMap {
    /// Return the ids of the entries whose boxes are in view, ascending.
    ///
    /// A box is in view unless it lies wholly outside of one of the five planes that bound what the
    /// image shows. So no box with a visible point is left out, and a box beside a corner of the
    /// image may be included.
    ///
    /// # Arguments
    /// * `max_distance_m` - largest distance on the ground plane from the camera to the middle of a
    ///   box.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] if the camera is impossible or the distance NaN.
    ///
    /// # Complexity
    /// O(entries).
    pub fn in_view(&self, camera: &Camera, max_distance_m: f64) -> Result<Vec<u64>, Error> {
        camera.check()?;
        Error::require("max_distance_m", max_distance_m, "at least 0", |v| v >= 0.0)?;
        let frustum = Frustum::new(camera);
        let [x, _, z] = camera.position_m;
        let is_in_view = |bounds_m: &Aabb| {
            let [centre_x, _, centre_z] = bounds_m.centre_m();
            distance_2d_m([x, z], [centre_x, centre_z]) <= max_distance_m
                && frustum.may_show(bounds_m, f64::INFINITY)
        };
        let shown = self.entries.iter().filter(|entry| is_in_view(entry.cloud.bounds_m()));
        Ok(shown.map(|entry| entry.id).collect())
    }
}

/// The part of space that an image shows.
pub(super) struct Frustum {
    position_m: Vec3,
    /// Inward normals of its planes, world frame; all planes contain the camera. The first is the
    /// unit vector along the optical axis.
    normals: [Vec3; 5],
}

impl Frustum {
    pub(super) fn new(camera: &Camera) -> Self {
        let ([u, v], focal_px) = (camera.centre_px(), camera.focal_px());
        let world_from_camera: Mat3 = transposed(&camera.camera_from_world());
        let inward = [
            [0.0, 0.0, 1.0],
            [focal_px, 0.0, u],
            [-focal_px, 0.0, camera.width_px as f64 - u],
            [0.0, focal_px, v],
            [0.0, -focal_px, camera.height_px as f64 - v],
        ];
        let normals = inward.map(|normal| rotate(&world_from_camera, normal));
        Self { position_m: camera.position_m, normals }
    }

    /// Return false if a box lies wholly outside of one of the planes, or beyond a depth.
    pub(super) fn may_show(&self, bounds_m: &Aabb, far_m: f64) -> bool {
        let centre_m = sub(bounds_m.centre_m(), self.position_m);
        let half_m = bounds_m.size_m().map(|edge| 0.5 * edge);
        let along = |normal: &Vec3| (0..3).map(|i| normal[i] * centre_m[i]).sum::<f64>();
        let reach = |normal: &Vec3| (0..3).map(|i| normal[i].abs() * half_m[i]).sum::<f64>();
        // A box that touches a plane may be rounded to either side.
        self.normals.iter().all(|normal| along(normal) + reach(normal) >= -1e-6)
            && along(&self.normals[0]) - reach(&self.normals[0]) <= far_m + 1e-6
    }
}
