//! Bindings of `evonav_core::simulator`.

mod batch;
mod embedded;

use pyo3::prelude::*;

/// Add the classes and functions to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    batch::register(module)?;
    embedded::register(module)
}
