//! `evonav_core::sensors`. Shapes, units and errors: `_core.pyi`.

use evonav_core::{
    Error,
    grid::GridSpec,
    sensors::{instance_masks, png, visible_cells::visible_cells as cast_rays},
};
use numpy::{
    PyArray1, PyArray2, PyArray3, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3,
    PyUntypedArrayMethods,
};
use pyo3::{prelude::*, types::PyBytes};

use crate::{arrays, error};

/// Return the visible cells: free ones and blocked ones.
#[pyfunction]
#[pyo3(signature = (blocked, *, cell_m, corner_m, origin_m, yaw_rad, horizontal_fov_rad, range_m))]
#[expect(clippy::too_many_arguments, reason = "keyword arguments of the Python function")]
#[expect(clippy::type_complexity, reason = "a pair of arrays")]
pub fn visible_cells<'py>(
    py: Python<'py>,
    blocked: PyReadonlyArray2<'py, u8>,
    cell_m: f64,
    corner_m: [f64; 2],
    origin_m: [f64; 2],
    yaw_rad: f64,
    horizontal_fov_rad: f64,
    range_m: f64,
) -> PyResult<(Bound<'py, PyArray2<i32>>, Bound<'py, PyArray2<i32>>)> {
    let (cells, [rows, cols]) = arrays::row_major("blocked", &blocked)?;
    let spec = GridSpec { rows, cols, cell_m, corner_m };
    let seen = py
        .detach(|| cast_rays(cells, &spec, origin_m, yaw_rad, horizontal_fov_rad, range_m))
        .map_err(error::to_py)?;
    Ok((arrays::rows_of(py, seen.free)?, arrays::rows_of(py, seen.blocked)?))
}

/// Renumber an instance image; return masks and instances of the detections.
#[pyfunction]
#[pyo3(signature = (instances, is_detectable, *, min_area_px, max_box_fraction))]
#[expect(clippy::type_complexity, reason = "a pair of arrays")]
pub fn number_instances<'py>(
    py: Python<'py>,
    instances: PyReadonlyArray2<'py, i32>,
    is_detectable: PyReadonlyArray1<'py, bool>,
    min_area_px: usize,
    max_box_fraction: f64,
) -> PyResult<(Bound<'py, PyArray2<i32>>, Bound<'py, PyArray1<i64>>)> {
    let (image, shape) = arrays::row_major("instances", &instances)?;
    let is_detectable = is_detectable.as_slice()?;
    let filter = instance_masks::MaskFilter { min_area_px, max_box_fraction };
    let masks = py
        .detach(|| instance_masks::number_instances(image, shape[1], is_detectable, filter))
        .map_err(error::to_py)?;
    let instances = masks.instances.into_iter().map(|index| index as i64).collect();
    Ok((arrays::image_of(py, masks.labels, shape)?, PyArray1::from_vec(py, instances)))
}

/// Give the detections of masks other numbers.
#[pyfunction]
pub fn renumber_masks<'py>(
    py: Python<'py>,
    masks: PyReadonlyArray2<'py, i32>,
    numbers: PyReadonlyArray1<'py, i32>,
) -> PyResult<Bound<'py, PyArray2<i32>>> {
    let (image, shape) = arrays::row_major("masks", &masks)?;
    let numbers = numbers.as_slice()?;
    let renumbered = py
        .detach(|| instance_masks::renumber_masks(image, shape[1], numbers))
        .map_err(error::to_py)?;
    arrays::image_of(py, renumbered, shape)
}

/// Count the pixels of each instance.
#[pyfunction]
pub fn instance_areas<'py>(
    py: Python<'py>,
    instances: PyReadonlyArray2<'py, i32>,
    num_instances: usize,
) -> PyResult<Bound<'py, PyArray1<i64>>> {
    let (image, _) = arrays::row_major("instances", &instances)?;
    let areas =
        py.detach(|| instance_masks::instance_areas(image, num_instances)).map_err(error::to_py)?;
    Ok(PyArray1::from_vec(py, areas))
}

/// Return one row per mask: area, left, top, right, bottom.
#[pyfunction]
#[pyo3(signature = (masks, *, num_masks))]
pub fn mask_extents<'py>(
    py: Python<'py>,
    masks: PyReadonlyArray2<'py, i32>,
    num_masks: usize,
) -> PyResult<Bound<'py, PyArray2<i64>>> {
    let (image, shape) = arrays::row_major("masks", &masks)?;
    let extents = py
        .detach(|| instance_masks::mask_extents(image, shape[1], num_masks))
        .map_err(error::to_py)?;
    let row = |extent: instance_masks::Extent| {
        let [[top, bottom], [left, right]] = [extent.rows, extent.cols];
        [extent.area_px, left, top, right, bottom].map(|px| px as i64)
    };
    arrays::rows_of(py, extents.into_iter().map(row).collect())
}

/// Encode an RGB image as PNG.
#[pyfunction]
pub fn encode_png<'py>(
    py: Python<'py>,
    rgb: PyReadonlyArray3<'py, u8>,
) -> PyResult<Bound<'py, PyBytes>> {
    let bytes = arrays::elements("rgb", &rgb)?;
    let &[height_px, width_px, 3] = rgb.shape() else {
        let found = format!("of shape {:?}", rgb.shape());
        return Err(error::to_py(Error::invalid("rgb", found, "an (H, W, 3) array")));
    };
    let file = py.detach(|| png::encode_png(bytes, [height_px, width_px]));
    Ok(PyBytes::new(py, &file.map_err(error::to_py)?))
}

/// Decode an RGB image from a PNG file.
#[pyfunction]
pub fn decode_png<'py>(py: Python<'py>, file: &[u8]) -> PyResult<Bound<'py, PyArray3<u8>>> {
    let (rgb, [height_px, width_px]) = py.detach(|| png::decode_png(file)).map_err(error::to_py)?;
    arrays::image_of(py, rgb, [height_px, width_px, 3])
}
