//! `evonav_core::perception`. Shapes, units and errors: `_core.pyi`.

use evonav_core::{
    perception::{
        self,
        depth_noise::{self, DepthNoise},
        false_detections::{self, SiteNoise},
        mask_distortion::MaskChange,
        mask_outlines::Outline,
    },
    rng::Stream,
};
use numpy::{
    PyArray2, PyReadonlyArray1, PyReadonlyArray2, PyReadwriteArray2, PyUntypedArrayMethods,
};
use pyo3::prelude::*;

use crate::{arrays, camera::DepthImage, error};

fn stream(seed: u64, labels: &[String]) -> Stream {
    Stream::new(seed, &labels.iter().map(String::as_str).collect::<Vec<_>>())
}

/// Draw standard normal numbers, one row per stream.
#[pyfunction]
#[pyo3(signature = (seed, labels, *, num_draws))]
pub fn draw_normals(
    py: Python<'_>,
    seed: u64,
    labels: Vec<Vec<String>>,
    num_draws: usize,
) -> PyResult<Bound<'_, PyArray2<f64>>> {
    let drawn = labels.iter().flat_map(|labels| {
        let mut stream = stream(seed, labels);
        (0..num_draws).map(move |_| stream.normal())
    });
    arrays::image_of(py, drawn.collect(), [labels.len(), num_draws])
}

/// Return one row per mask: sides of its outline, cut sides, mean depth.
#[pyfunction]
#[pyo3(signature = (masks, depth_m, *, num_masks))]
pub fn mask_outlines<'py>(
    py: Python<'py>,
    masks: PyReadonlyArray2<'py, i32>,
    depth_m: PyReadonlyArray2<'py, f32>,
    num_masks: usize,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (masks, shape) = arrays::row_major("masks", &masks)?;
    let (depth_m, _) = arrays::row_major("depth_m", &depth_m)?;
    let outlines = py
        .detach(|| perception::mask_outlines::mask_outlines(masks, depth_m, shape[1], num_masks))
        .map_err(error::to_py)?;
    let row = |one: Outline| [one.num_sides as f64, one.num_cut as f64, one.mean_depth_m];
    arrays::rows_of(py, outlines.into_iter().map(row).collect())
}

/// Shrink, grow, cut, split and renumber masks.
#[pyfunction]
pub fn distort_masks<'py>(
    py: Python<'py>,
    masks: PyReadonlyArray2<'py, i32>,
    changes: PyReadonlyArray2<'py, i32>,
    margins_px: PyReadonlyArray1<'py, f64>,
) -> PyResult<Bound<'py, PyArray2<i32>>> {
    let (masks, shape) = arrays::row_major("masks", &masks)?;
    let rows = arrays::rows("changes", &changes)?.iter().zip(margins_px.as_slice()?);
    let changes = rows.map(
        |(&[becomes, rest_becomes, by_col, split_px, top, left, bottom, right], &margin_px)| {
            MaskChange {
                becomes,
                rest_becomes,
                is_split_by_col: by_col != 0,
                split_px,
                margin_px,
                crop_px: [top, left, bottom, right],
            }
        },
    );
    let changes: Vec<_> = changes.collect();
    let found = py
        .detach(|| perception::mask_distortion::distort_masks(masks, shape[1], &changes))
        .map_err(error::to_py)?;
    arrays::image_of(py, found, shape)
}

/// Find the sites in view where something may be detected that does not exist.
#[pyfunction]
#[pyo3(signature = (
    frame, *, cell_m, stride_px, persistence, seed, lasting, passing,
))]
#[expect(clippy::too_many_arguments, reason = "keyword arguments of the Python function")]
#[expect(clippy::type_complexity, reason = "a pair of arrays")]
pub fn surface_sites<'py>(
    py: Python<'py>,
    frame: DepthImage<'py>,
    cell_m: f64,
    stride_px: usize,
    persistence: f64,
    seed: u64,
    lasting: Vec<String>,
    passing: Vec<String>,
) -> PyResult<(Bound<'py, PyArray2<i64>>, Bound<'py, PyArray2<f64>>)> {
    let (camera, depth_m) = frame.borrow()?;
    let (lasting, passing) = (stream(seed, &lasting), stream(seed, &passing));
    let noise = SiteNoise { cell_m, stride_px, persistence, lasting, passing };
    let sites = py
        .detach(|| false_detections::surface_sites(depth_m, &camera, &noise))
        .map_err(error::to_py)?;
    let pixels = sites.iter().map(|site| site.pixel.map(|px| px as i64)).collect();
    let values = sites.iter().map(|s| [s.depth_m, s.latent, s.what[0], s.what[1], s.how]).collect();
    Ok((arrays::rows_of(py, pixels)?, arrays::rows_of(py, values)?))
}

/// Paint ellipses into masks, in place.
#[pyfunction]
pub fn paint_blobs(
    mut masks: PyReadwriteArray2<'_, i32>,
    surfaces: PyReadonlyArray2<'_, i32>,
    blobs: PyReadonlyArray2<'_, i64>,
    radii_px: PyReadonlyArray2<'_, f64>,
) -> PyResult<()> {
    let width_px = masks.shape()[1];
    let masks = arrays::whole_mut("masks", &mut masks)?;
    let (surfaces, _) = arrays::row_major("surfaces", &surfaces)?;
    let rows = arrays::rows("blobs", &blobs)?.iter().zip(arrays::rows("radii_px", &radii_px)?);
    // Negative positions become positions outside the image, which the core rejects.
    let blobs: Vec<_> = rows
        .map(|(&[row, col, number], &radii_px)| false_detections::Blob {
            pixel: [row, col].map(|px| usize::try_from(px).unwrap_or(usize::MAX)),
            radii_px,
            number: number as i32,
        })
        .collect();
    false_detections::paint_blobs(masks, surfaces, width_px, &blobs).map_err(error::to_py)
}

/// Add a camera's errors to a depth image.
#[pyfunction]
#[pyo3(signature = (
    depth_m, *, sigma_m, sigma_per_m, step_per_m, dropout, edge_dropout, max_depth_m, seed, labels,
))]
#[expect(clippy::too_many_arguments, reason = "keyword arguments of the Python function")]
pub fn noisy_depth<'py>(
    py: Python<'py>,
    depth_m: PyReadonlyArray2<'py, f32>,
    sigma_m: f64,
    sigma_per_m: f64,
    step_per_m: f64,
    dropout: f64,
    edge_dropout: f64,
    max_depth_m: f64,
    seed: u64,
    labels: Vec<String>,
) -> PyResult<Bound<'py, PyArray2<f32>>> {
    let (depth_m, shape) = arrays::row_major("depth_m", &depth_m)?;
    let noise = DepthNoise { sigma_m, sigma_per_m, step_per_m, dropout, edge_dropout, max_depth_m };
    let found = py
        .detach(|| depth_noise::noisy_depth(depth_m, shape[1], &noise, &stream(seed, &labels)))
        .map_err(error::to_py)?;
    arrays::image_of(py, found, shape)
}
