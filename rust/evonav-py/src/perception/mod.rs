//! Bindings of `evonav_core::perception`.

mod mini;
mod noise;

use pyo3::prelude::*;

/// Add the classes and functions to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    mini::register(module)?;
    noise::register(module)
}
