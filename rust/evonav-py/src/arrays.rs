//! Borrowing numpy arrays.

use evonav_core::Error;
use numpy::{Element, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::error;

/// Elements and shape of a C-contiguous array; rust-numpy's own `as_slice` also takes Fortran
/// order, which would arrive transposed.
pub fn row_major<'a, T: Element>(
    name: &str,
    array: &'a PyReadonlyArray2<'_, T>,
) -> PyResult<(&'a [T], [usize; 2])> {
    if !array.is_c_contiguous() {
        return Err(error::to_py(Error::invalid(name, "not C-contiguous", "a C-contiguous array")));
    }
    let shape = array.shape();
    Ok((array.as_slice()?, [shape[0], shape[1]]))
}
