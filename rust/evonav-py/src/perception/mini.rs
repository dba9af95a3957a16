//! `evonav_core::perception::mini`. Shapes, units and errors: `_core.pyi`.

use evonav_core::{
    Error,
    perception::mini::{
        detector,
        instances::Resemblance,
        network::{self, Network},
    },
};
use numpy::{
    PyArray1, PyArray2, PyArray3, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods,
};
use pyo3::prelude::*;

use crate::{arrays, error};

/// The detector's network with its weights.
#[pyclass(frozen, module = "evonav._core")]
pub struct MiniNetwork(Network);

#[pymethods]
impl MiniNetwork {
    #[new]
    fn new(py: Python<'_>, weights: &[u8]) -> PyResult<Self> {
        py.detach(|| Network::read(weights)).map(Self).map_err(error::to_py)
    }

    /// Return the classes that it distinguishes.
    #[getter]
    fn classes(&self) -> Vec<String> {
        self.0.classes().to_vec()
    }

    /// Compute the logits of each cell.
    fn logits<'py>(
        &self,
        py: Python<'py>,
        rgb: PyReadonlyArray3<'py, u8>,
        depth_m: PyReadonlyArray2<'py, f32>,
        horizon_rad: f64,
    ) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let (pixels, depths, size_px) = picture(&rgb, &depth_m)?;
        let logits = py
            .detach(|| self.0.run(&network::input(pixels, depths, size_px, horizon_rad)?))
            .map_err(error::to_py)?;
        let shape = logits.shape();
        arrays::image_of(py, logits.values, shape)
    }

    /// Detect instances; return masks, classes and confidences.
    #[pyo3(signature = (rgb, depth_m, horizon_rad, *, min_cells, min_confidence))]
    #[expect(clippy::type_complexity, reason = "a triple of arrays")]
    fn detect<'py>(
        &self,
        py: Python<'py>,
        rgb: PyReadonlyArray3<'py, u8>,
        depth_m: PyReadonlyArray2<'py, f32>,
        horizon_rad: f64,
        min_cells: usize,
        min_confidence: f32,
    ) -> PyResult<(Bound<'py, PyArray2<i32>>, Bound<'py, PyArray1<i64>>, Bound<'py, PyArray1<f32>>)>
    {
        let (pixels, depths, size_px) = picture(&rgb, &depth_m)?;
        let resemblance = Resemblance::default();
        let config = detector::DetectorConfig { min_cells, min_confidence, resemblance };
        let found = py
            .detach(|| detector::detect(&self.0, pixels, depths, size_px, horizon_rad, &config))
            .map_err(error::to_py)?;
        let classes = found.classes.into_iter().map(|class| class as i64).collect();
        Ok((
            arrays::image_of(py, found.masks, [size_px[1], size_px[0]])?,
            PyArray1::from_vec(py, classes),
            PyArray1::from_vec(py, found.confidences),
        ))
    }
}

/// Return pixels, depths, width and height of an image.
fn picture<'a>(
    rgb: &'a PyReadonlyArray3<'_, u8>,
    depth_m: &'a PyReadonlyArray2<'_, f32>,
) -> PyResult<(&'a [u8], &'a [f32], [usize; 2])> {
    let (depths, [height, width]) = arrays::row_major("depth_m", depth_m)?;
    if !rgb.is_c_contiguous() || rgb.shape() != [height, width, 3] {
        let expected =
            format!("a C-contiguous array of shape ({height}, {width}, 3), as the depths");
        let found = format!("of shape {:?}", rgb.shape());
        return Err(error::to_py(Error::invalid("rgb", found, &expected)));
    }
    Ok((rgb.as_slice()?, depths, [width, height]))
}
