//! `evonav_core::sensors::runs`: images of numbers, as runs or as arrays. Shapes and errors: `_core.pyi`.

use std::sync::Arc;

use evonav_core::sensors::runs;
use numpy::{PyArray2, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::{arrays, error};

/// An image of numbers as runs of equal pixels.
#[pyclass(frozen, eq, module = "evonav._core")]
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RunImage(Arc<runs::RunImage>);

impl RunImage {
    pub fn new(image: runs::RunImage) -> Self {
        Self(Arc::new(image))
    }
}

#[pymethods]
impl RunImage {
    #[new]
    fn from_ends(shape: [usize; 2], ends: PyReadonlyArray2<'_, i32>) -> PyResult<Self> {
        let ends = arrays::rows("ends", &ends)?;
        runs::RunImage::from_ends(shape, ends).map(Self::new).map_err(error::to_py)
    }

    #[staticmethod]
    fn of(py: Python<'_>, pixels: PyReadonlyArray2<'_, i32>) -> PyResult<Self> {
        Ok(Self(NumberImage::Pixels(pixels).runs(py, "pixels")?))
    }

    #[getter]
    fn shape(&self) -> (usize, usize) {
        self.0.shape().into()
    }

    #[getter]
    fn ends<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<i32>>> {
        arrays::rows_of(py, self.0.ends().to_vec())
    }

    fn pixels<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<i32>>> {
        arrays::image_of(py, py.detach(|| self.0.pixels()), self.0.shape())
    }

    fn __repr__(&self) -> String {
        let [height_px, width_px] = self.0.shape();
        format!("RunImage({height_px} x {width_px} pixels, {} runs)", self.0.ends().len())
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Parts<'py>)> {
        Ok((py.get_type::<Self>().into_any(), (self.shape(), self.ends(py)?)))
    }
}

type Parts<'py> = ((usize, usize), Bound<'py, PyArray2<i32>>);

/// An image of numbers in either form.
pub enum NumberImage<'py> {
    Runs(Arc<runs::RunImage>),
    Pixels(PyReadonlyArray2<'py, i32>),
}

impl<'py> FromPyObject<'_, 'py> for NumberImage<'py> {
    type Error = PyErr;

    fn extract(object: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        match object.cast::<RunImage>() {
            Ok(image) => Ok(Self::Runs(Arc::clone(&image.get().0))),
            Err(_) => Ok(Self::Pixels(object.extract()?)),
        }
    }
}

impl NumberImage<'_> {
    /// Return the runs of the image.
    pub fn runs(&self, py: Python<'_>, name: &str) -> PyResult<Arc<runs::RunImage>> {
        match self {
            Self::Runs(image) => Ok(Arc::clone(image)),
            Self::Pixels(pixels) => {
                let (pixels, shape) = arrays::row_major(name, pixels)?;
                let image = py.detach(|| runs::RunImage::of(pixels, shape[1]));
                image.map(Arc::new).map_err(error::to_py)
            }
        }
    }
}
