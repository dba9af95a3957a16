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

use crate::{
    arrays, error,
    run_image::{NumberImage, RunImage},
};

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
pub fn number_instances<'py>(
    py: Python<'py>,
    instances: NumberImage<'py>,
    is_detectable: PyReadonlyArray1<'py, bool>,
    min_area_px: usize,
    max_box_fraction: f64,
) -> PyResult<(RunImage, Vec<usize>)> {
    let filter = instance_masks::MaskFilter { min_area_px, max_box_fraction };
    let image = instances.runs(py, "instances")?;
    let masks = instance_masks::number_instances(&image, is_detectable.as_slice()?, filter)
        .map_err(error::to_py)?;
    Ok((RunImage::new(masks.labels), masks.instances))
}

/// Give the detections of masks other numbers.
#[pyfunction]
pub fn renumber_masks(
    py: Python<'_>,
    masks: NumberImage<'_>,
    numbers: PyReadonlyArray1<'_, i32>,
) -> PyResult<RunImage> {
    let masks = masks.runs(py, "masks")?;
    let renumbered = instance_masks::renumber_masks(&masks, numbers.as_slice()?);
    renumbered.map(RunImage::new).map_err(error::to_py)
}

/// Count the pixels of each instance.
#[pyfunction]
pub fn instance_areas<'py>(
    py: Python<'py>,
    instances: NumberImage<'py>,
    num_instances: usize,
) -> PyResult<Bound<'py, PyArray1<i64>>> {
    let image = instances.runs(py, "instances")?;
    let areas = instance_masks::instance_areas(&image, num_instances).map_err(error::to_py)?;
    Ok(PyArray1::from_vec(py, areas))
}

/// Return one row per mask: area, left, top, right, bottom.
#[pyfunction]
#[pyo3(signature = (masks, *, num_masks))]
pub fn mask_extents<'py>(
    py: Python<'py>,
    masks: NumberImage<'py>,
    num_masks: usize,
) -> PyResult<Bound<'py, PyArray2<i64>>> {
    let masks = masks.runs(py, "masks")?;
    let extents = instance_masks::mask_extents(&masks, num_masks).map_err(error::to_py)?;
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
