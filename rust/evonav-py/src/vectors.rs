//! The width of the vectors that kernels compute with.

use pyo3::prelude::*;

/// Return whether kernels compute with wider vectors than those of every processor.
#[pyfunction]
pub fn has_wide_vectors() -> bool {
    evonav_simd::is_wide()
}
