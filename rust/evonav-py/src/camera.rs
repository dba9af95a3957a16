//! Cameras of Python, and pinhole projection of arrays. Shapes, units and errors: `_core.pyi`.

use evonav_core::{
    geometry::{Pose, Vec3},
    sensors::{
        camera::Camera,
        unproject::{self, MaskedDepth},
    },
};
use numpy::{PyArray1, PyArray2, PyArray3, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::{arrays, error, run_image::NumberImage};

/// `evonav.world.pose.Pose`.
#[derive(FromPyObject)]
pub struct PyPose {
    position_m: Vec3,
    yaw_rad: f64,
    horizon_rad: f64,
}

/// `evonav.world.simulator.Intrinsics`.
#[derive(FromPyObject)]
pub struct Intrinsics {
    width_px: usize,
    height_px: usize,
    pub vertical_fov_rad: f64,
}

/// The depth image of a `Frame` or `View` of Python.
#[derive(FromPyObject)]
pub struct DepthImage<'py> {
    depth_m: PyReadonlyArray2<'py, f32>,
    pose: PyPose,
    intrinsics: Intrinsics,
}

impl PyPose {
    /// Return the pose.
    pub fn pose(&self) -> Pose {
        let &Self { position_m, yaw_rad, horizon_rad } = self;
        Pose { position_m, yaw_rad, horizon_rad }
    }

    /// Return a camera at this pose.
    pub fn camera(&self, [width_px, height_px]: [usize; 2], vertical_fov_rad: f64) -> Camera {
        let &Self { position_m, yaw_rad, horizon_rad } = self;
        Camera { width_px, height_px, vertical_fov_rad, position_m, yaw_rad, horizon_rad }
    }
}

impl DepthImage<'_> {
    /// Return the camera and the depths; the camera's image has the size of the depth image.
    pub fn borrow(&self) -> PyResult<(Camera, &[f32])> {
        let (depth_m, [height_px, width_px]) = arrays::row_major("depth_m", &self.depth_m)?;
        let vertical_fov_rad = self.intrinsics.vertical_fov_rad;
        Ok((self.pose.camera([width_px, height_px], vertical_fov_rad), depth_m))
    }
}

#[pyfunction]
pub fn unproject_image<'py>(
    py: Python<'py>,
    depth_m: PyReadonlyArray2<'py, f32>,
    pose: PyPose,
    intrinsics: Intrinsics,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let image = DepthImage { depth_m, pose, intrinsics };
    let (camera, depth_m) = image.borrow()?;
    let points_m = py.detach(|| camera.unproject_image(depth_m)).map_err(error::to_py)?;
    arrays::image_of(py, points_m.into_flattened(), [camera.height_px, camera.width_px, 3])
}

#[pyfunction]
#[pyo3(signature = (view, masks, *, num_detections, max_points))]
#[expect(clippy::type_complexity, reason = "a pair of arrays")]
pub fn unproject_masks<'py>(
    py: Python<'py>,
    view: DepthImage<'py>,
    masks: NumberImage<'py>,
    num_detections: usize,
    max_points: usize,
) -> PyResult<(Bound<'py, PyArray2<f32>>, Bound<'py, PyArray1<i64>>)> {
    let (camera, depth_m) = view.borrow()?;
    let masks = &*masks.runs(py, "masks")?;
    let image = MaskedDepth { camera, depth_m, masks };
    let clouds = py
        .detach(|| unproject::unproject_masks(image, num_detections, max_points))
        .map_err(error::to_py)?;
    let ends = clouds.iter().scan(0, |end, cloud| {
        *end += cloud.len() as i64;
        Some(*end)
    });
    let ends = PyArray1::from_vec(py, ends.collect());
    Ok((arrays::rows_of(py, clouds.concat())?, ends))
}

#[pyfunction]
pub fn project_points<'py>(
    py: Python<'py>,
    points_m: PyReadonlyArray2<'py, f64>,
    pose: PyPose,
    intrinsics: Intrinsics,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let points_m = arrays::rows("points_m", &points_m)?;
    let Intrinsics { width_px, height_px, vertical_fov_rad } = intrinsics;
    let camera = pose.camera([width_px, height_px], vertical_fov_rad);
    let projected = py.detach(|| camera.project_all(points_m)).map_err(error::to_py)?;
    arrays::rows_of(py, projected)
}
