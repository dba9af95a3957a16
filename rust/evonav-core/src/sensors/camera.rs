//! The pinhole camera of AI2-THOR: square pixels, no distortion.

use crate::{
    Error,
    geometry::{Mat3, Pose, Vec2, Vec3, add, rotate, sub},
};

/// Largest number of pixels along a side of an image.
pub const MAX_SIDE_PX: usize = 8192;

/// A pinhole camera somewhere in the world.
///
/// Its own frame is OpenCV's: x right, y down, z forward. Pixel `(row, col)` covers
/// `[col, col + 1) x [row, row + 1)` of the image plane; its centre is at half-integers. The
/// principal point is the middle of the image. Depth is planar: the z coordinate, not the range.
///
/// # Examples
/// ```
/// # use evonav_core::sensors::camera::Camera;
/// let camera = Camera {
///     width_px: 300,
///     height_px: 300,
///     vertical_fov_rad: std::f64::consts::FRAC_PI_2,
///     position_m: [0.0, 1.575, 0.0],
///     yaw_rad: 0.0,
///     horizon_rad: 0.0,
/// };
/// // Two metres ahead and one to the right: a quarter of the image right of its middle.
/// assert_eq!(camera.project([1.0, 1.575, 2.0]).map(|p| p[0].round()), Some(225.0));
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// Columns of the image.
    pub width_px: usize,
    /// Rows of the image.
    pub height_px: usize,
    /// Field of view from the upper to the lower border (AI2-THOR's `fieldOfView`: 90 degrees).
    pub vertical_fov_rad: f64,
    /// Optical centre, world frame.
    pub position_m: Vec3,
    /// Heading: 0 along +z, growing towards +x.
    pub yaw_rad: f64,
    /// Pitch; positive looks down.
    pub horizon_rad: f64,
}

impl Camera {
    /// Create the camera of an agent at `pose`, `height_m` over the floor. Houses have one floor,
    /// at y = 0, so the pose's own height, 0.9 m in AI2-THOR and 0 elsewhere, does not matter.
    pub fn at(pose: &Pose, image_px: [usize; 2], vertical_fov_rad: f64, height_m: f64) -> Self {
        let [x, _, z] = pose.position_m;
        Self {
            width_px: image_px[0],
            height_px: image_px[1],
            vertical_fov_rad,
            position_m: [x, height_m, z],
            yaw_rad: pose.yaw_rad,
            horizon_rad: pose.horizon_rad,
        }
    }

    /// Check that an image can be formed.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] if a side is 0 or above [`MAX_SIDE_PX`], the field of view not
    /// in `(0, pi)`, or a number not finite.
    pub fn check(&self) -> Result<(), Error> {
        let is_side = |n: usize| (1..=MAX_SIDE_PX).contains(&n);
        Error::require("width_px", self.width_px, "1 to 8192", is_side)?;
        Error::require("height_px", self.height_px, "1 to 8192", is_side)?;
        Error::require("vertical_fov_rad", self.vertical_fov_rad, "0.01 to 3.1", |v| {
            (0.01..=3.1).contains(&v)
        })?;
        Error::require_finite("position_m", &self.position_m)?;
        Error::require("yaw_rad", self.yaw_rad, "finite", f64::is_finite)?;
        Error::require("horizon_rad", self.horizon_rad, "finite", f64::is_finite)
    }

    /// Return the focal length in pixels, the same along both axes.
    pub fn focal_px(&self) -> f64 {
        self.height_px as f64 / 2.0 / (self.vertical_fov_rad / 2.0).tan()
    }

    /// Return the principal point `[u, v]`: the middle of the image.
    pub fn centre_px(&self) -> Vec2 {
        [self.width_px as f64 / 2.0, self.height_px as f64 / 2.0]
    }

    /// Return the rotation from world to camera; its rows are the camera's right, down and forward
    /// axes in the world frame.
    pub fn camera_from_world(&self) -> Mat3 {
        let (sin_yaw, cos_yaw) = self.yaw_rad.sin_cos();
        let (sin_pitch, cos_pitch) = self.horizon_rad.sin_cos();
        [
            [cos_yaw, 0.0, -sin_yaw],
            [-sin_yaw * sin_pitch, -cos_pitch, -cos_yaw * sin_pitch],
            [sin_yaw * cos_pitch, -sin_pitch, cos_yaw * cos_pitch],
        ]
    }

    /// Project a world point to `[u, v, depth_m]`: image coordinates in pixels and planar depth.
    ///
    /// # Returns
    /// `None` for points that are not in front of the camera; the image's borders are not checked.
    pub fn project(&self, point_m: Vec3) -> Option<Vec3> {
        let [x, y, z] = rotate(&self.camera_from_world(), sub(point_m, self.position_m));
        let [centre_u, centre_v] = self.centre_px();
        let scale = self.focal_px() / z;
        (z > 0.0).then_some([centre_u + scale * x, centre_v + scale * y, z])
    }

    /// Return the world point at planar depth `depth_m` behind image coordinates `[u, v]`: the
    /// inverse of [`Self::project`]. The coordinates of a pixel are `[col + 0.5, row + 0.5]`.
    pub fn unproject(&self, image_px: Vec2, depth_m: f64) -> Vec3 {
        add(self.position_m, self.ray(image_px).map(|d| d * depth_m))
    }

    /// Return the world points behind a whole depth image, row-major; not finite where the depth is
    /// not.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] if the image's size is not the camera's, and as [`Self::check`].
    pub fn unproject_image(&self, depth_m: &[f32]) -> Result<Vec<Vec3>, Error> {
        self.check()?;
        Error::require("depth_m", depth_m.len(), "one value a pixel of the camera", |n| {
            n == self.width_px * self.height_px
        })?;
        let centre = |i: usize| [i % self.width_px, i / self.width_px].map(|k| k as f64 + 0.5);
        let points = depth_m.iter().enumerate();
        Ok(points.map(|(i, &depth)| self.unproject(centre(i), f64::from(depth))).collect())
    }

    /// Project many points as [`Self::project`]; NaN for those that are not in front of the camera.
    ///
    /// # Errors
    /// As [`Self::check`].
    pub fn project_all(&self, points_m: &[Vec3]) -> Result<Vec<Vec3>, Error> {
        self.check()?;
        Ok(points_m.iter().map(|&p| self.project(p).unwrap_or([f64::NAN; 3])).collect())
    }

    /// Return the world direction through image coordinates `[u, v]`, of length 1 along the optical
    /// axis.
    pub fn ray(&self, image_px: Vec2) -> Vec3 {
        let ([centre_u, centre_v], focal_px) = (self.centre_px(), self.focal_px());
        let local = [(image_px[0] - centre_u) / focal_px, (image_px[1] - centre_v) / focal_px, 1.0];
        let axes = self.camera_from_world();
        std::array::from_fn(|i| (0..3).map(|j| axes[j][i] * local[j]).sum())
    }
}

/// AI2-THOR's clip planes ("cameraNearPlane", "cameraFarPlane" of its `Initialize`).
pub const CLIP_M: [f64; 2] = [0.1, 20.0];

/// The view that a renderer draws: a camera with the additional properties of Unity's cameras.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// Size, position and direction. An orthographic view does not use the field of view.
    pub camera: Camera,
    /// Planar depths `[near, far]` between which surfaces are drawn.
    pub clip_m: Vec2,
    /// Turn about the optical axis, applied before all others: Unity's z rotation, which turns the
    /// right side of the image up.
    pub roll_rad: f64,
    /// Half of the image's height in the world for an orthographic view (Unity's
    /// `orthographicSize`); `None` for a perspective one.
    pub half_height_m: Option<f64>,
}

impl From<Camera> for View {
    fn from(camera: Camera) -> Self {
        Self { camera, clip_m: CLIP_M, roll_rad: 0.0, half_height_m: None }
    }
}

impl View {
    /// Check that an image can be formed.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] as [`Camera::check`], or if the clip planes are not finite,
    /// rising and at least 0.1 mm away, the roll not finite, or the half height not positive.
    pub fn check(&self) -> Result<(), Error> {
        self.camera.check()?;
        let [near_m, far_m] = self.clip_m;
        Error::require("near_m", near_m, "0.0001 or more, below far_m", |v| {
            v >= 1e-4 && v < far_m
        })?;
        Error::require("far_m", far_m, "at most 1e6", |v| v <= 1e6)?;
        Error::require("roll_rad", self.roll_rad, "finite", f64::is_finite)?;
        let is_half_height = |v: f64| (1e-3..=1e6).contains(&v);
        Error::require(
            "half_height_m",
            self.half_height_m.unwrap_or(1.0),
            "0.001 to 1e6",
            is_half_height,
        )
    }

    /// Return the rotation from world to image; its rows are the image's right, down and forward
    /// axes in the world frame.
    pub fn axes(&self) -> Mat3 {
        let [right, down, forward] = self.camera.camera_from_world();
        let (sin, cos) = self.roll_rad.sin_cos();
        [
            std::array::from_fn(|i| cos * right[i] - sin * down[i]),
            std::array::from_fn(|i| sin * right[i] + cos * down[i]),
            forward,
        ]
    }
    /// Return whether a point is in front of the camera and inside the image's borders; the clip
    /// planes do not count.
    pub fn frames(&self, point_m: Vec3) -> bool {
        let [x, y, z] = rotate(&self.axes(), sub(point_m, self.camera.position_m));
        let [half_width_px, half_height_px] = self.camera.centre_px();
        let scale_px = match self.half_height_m {
            None => self.camera.focal_px() / z,
            Some(half_m) => half_height_px / half_m,
        };
        z > 0.0 && (scale_px * x).abs() < half_width_px && (scale_px * y).abs() < half_height_px
    }
}
