//! Borrow numpy arrays, and create them from vectors.

use evonav_core::Error;
use numpy::{
    Element, PyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray, PyReadonlyArray2,
    PyReadwriteArray, PyUntypedArrayMethods,
    ndarray::{Dimension, IntoDimension},
};
use pyo3::prelude::*;

use crate::error;

/// Read the fields of a struct from the attributes of the same names of a Python object.
macro_rules! from_attributes {
    ($object:expr, $name:ident { $($field:ident),* $(,)? }) => {
        $name { $($field: $object.getattr(stringify!($field))?.extract()?),* }
    };
}
pub(crate) use from_attributes;

/// Return the elements of a C-contiguous array. rust-numpy's own `as_slice` also accepts Fortran
/// order, which would arrive transposed.
pub fn elements<'a, T: Element, D: Dimension>(
    name: &str,
    array: &'a PyReadonlyArray<'_, T, D>,
) -> PyResult<&'a [T]> {
    require_c_contiguous(name, array.is_c_contiguous())?;
    Ok(array.as_slice()?)
}

/// Return the elements and shape of a C-contiguous array, as [`elements`].
pub fn row_major<'a, T: Element>(
    name: &str,
    array: &'a PyReadonlyArray2<'_, T>,
) -> PyResult<(&'a [T], [usize; 2])> {
    let shape = array.shape();
    Ok((elements(name, array)?, [shape[0], shape[1]]))
}

/// Return the elements of a C-contiguous array of any shape for writing.
pub fn whole_mut<'a, T: Element, D: Dimension>(
    name: &str,
    array: &'a mut PyReadwriteArray<'_, T, D>,
) -> PyResult<&'a mut [T]> {
    require_c_contiguous(name, array.is_c_contiguous())?;
    Ok(array.as_slice_mut()?)
}

fn require_c_contiguous(name: &str, is_c_contiguous: bool) -> PyResult<()> {
    let found = || Error::invalid(name, "not C-contiguous", "a C-contiguous array");
    if is_c_contiguous { Ok(()) } else { Err(error::to_py(found())) }
}

/// Return the elements of an image after checking its `[width, height]`.
pub fn image<'a, T: Element>(
    name: &str,
    array: &'a PyReadonlyArray2<'_, T>,
    [width_px, height_px]: [usize; 2],
) -> PyResult<&'a [T]> {
    let (pixels, shape) = row_major(name, array)?;
    if shape != [height_px, width_px] {
        let found = format!("of shape {shape:?}");
        let expected = format!("an array of shape {:?}", [height_px, width_px]);
        return Err(error::to_py(Error::invalid(name, found, &expected)));
    }
    Ok(pixels)
}

/// Return the `(N, 2)` `[row, col]` rows of an array.
pub fn cells(name: &str, array: &PyReadonlyArray2<'_, i32>) -> PyResult<Vec<[i32; 2]>> {
    Ok(rows(name, array)?.to_vec())
}

/// Return the `N` rows of an `(N, M)` array.
pub fn rows<'a, T: Element, const M: usize>(
    name: &str,
    array: &'a PyReadonlyArray2<'_, T>,
) -> PyResult<&'a [[T; M]]> {
    let (values, shape) = row_major(name, array)?;
    if shape[1] != M {
        let found = format!("of shape ({}, {})", shape[0], shape[1]);
        let expected = format!("an array of shape (N, {M})");
        return Err(error::to_py(Error::invalid(name, found, &expected)));
    }
    Ok(values.as_chunks().0)
}

/// Create an `(N, M)` array from `N` rows; the memory moves, nothing is copied.
pub fn rows_of<T: Element, const M: usize>(
    py: Python<'_>,
    rows: Vec<[T; M]>,
) -> PyResult<Bound<'_, PyArray2<T>>> {
    let shape = [rows.len(), M];
    image_of(py, rows.into_flattened(), shape)
}

/// Create an array of a shape from elements in row-major order; the memory moves, nothing is
/// copied.
pub fn image_of<T: Element, D: IntoDimension>(
    py: Python<'_>,
    elements: Vec<T>,
    shape: D,
) -> PyResult<Bound<'_, PyArray<T, D::Dim>>> {
    PyArray1::from_vec(py, elements).reshape(shape)
}
