//! Pinhole projection of arrays. Shapes, units and errors: `_core.pyi`.

use evonav_core::{
    geometry::Vec3,
    sensors::{
        camera::Camera,
        unproject::{self, MaskedDepth},
    },
};
use numpy::{PyArray1, PyArray2, PyArray3, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::{arrays, error};

#[pyfunction]
#[pyo3(signature = (depth_m, *, vertical_fov_rad, position_m, yaw_rad, horizon_rad))]
fn unproject_image<'py>(
    py: Python<'py>,
    depth_m: PyReadonlyArray2<'py, f32>,
    vertical_fov_rad: f64,
    position_m: Vec3,
    yaw_rad: f64,
    horizon_rad: f64,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let (depth_m, [height_px, width_px]) = arrays::row_major("depth_m", &depth_m)?;
    let camera = Camera { width_px, height_px, vertical_fov_rad, position_m, yaw_rad, horizon_rad };
    let points_m = py.detach(|| camera.unproject_image(depth_m)).map_err(error::to_py)?;
    arrays::image_of(py, points_m.into_flattened(), [height_px, width_px, 3])
}

#[pyfunction]
#[pyo3(signature = (
    depth_m, masks, *, num_detections, max_points, vertical_fov_rad, position_m, yaw_rad, horizon_rad,
))]
#[expect(clippy::too_many_arguments, reason = "keyword arguments of the Python function")]
#[expect(clippy::type_complexity, reason = "a pair of arrays")]
fn unproject_masks<'py>(
    py: Python<'py>,
    depth_m: PyReadonlyArray2<'py, f32>,
    masks: PyReadonlyArray2<'py, i32>,
    num_detections: usize,
    max_points: usize,
    vertical_fov_rad: f64,
    position_m: Vec3,
    yaw_rad: f64,
    horizon_rad: f64,
) -> PyResult<(Bound<'py, PyArray2<f32>>, Bound<'py, PyArray1<i64>>)> {
    let (depth_m, [height_px, width_px]) = arrays::row_major("depth_m", &depth_m)?;
    let (masks, _) = arrays::row_major("masks", &masks)?;
    let camera = Camera { width_px, height_px, vertical_fov_rad, position_m, yaw_rad, horizon_rad };
    let image = MaskedDepth { camera: &camera, depth_m, masks };
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
#[pyo3(signature = (points_m, *, image_px, vertical_fov_rad, position_m, yaw_rad, horizon_rad))]
fn project_points<'py>(
    py: Python<'py>,
    points_m: PyReadonlyArray2<'py, f64>,
    image_px: [usize; 2],
    vertical_fov_rad: f64,
    position_m: Vec3,
    yaw_rad: f64,
    horizon_rad: f64,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let points_m = arrays::rows("points_m", &points_m)?;
    let [width_px, height_px] = image_px;
    let camera = Camera { width_px, height_px, vertical_fov_rad, position_m, yaw_rad, horizon_rad };
    let projected = py.detach(|| camera.project_all(points_m)).map_err(error::to_py)?;
    arrays::rows_of(py, projected)
}

/// Add the functions to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(unproject_image, module)?)?;
    module.add_function(wrap_pyfunction!(unproject_masks, module)?)?;
    module.add_function(wrap_pyfunction!(project_points, module)?)
}
