//! Bindings of `evonav_core::memory`.

mod objects;
mod occupancy;
mod snapshots;

use pyo3::prelude::*;

/// Add the classes and functions to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    objects::register(module)?;
    occupancy::register(module)?;
    snapshots::register(module)
}
