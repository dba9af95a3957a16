//! Physics of a changed house.

use evonav_core::{
    assets::Catalogue,
    world::inspection::{Tolerances, inspect_houses},
};
use pyo3::prelude::*;

use crate::{
    error,
    house::{House, unknown_assets},
};

/// Inspect a house. Units and errors: `_core.pyi` and `evonav_core::world::inspection`.
#[pyfunction]
#[pyo3(signature = (source, stage, *, touch_m, rest_m, allow_unknown_assets))]
pub fn inspect_house(
    py: Python<'_>,
    source: &House,
    stage: &House,
    touch_m: f64,
    rest_m: f64,
    allow_unknown_assets: bool,
) -> PyResult<String> {
    let unknown = unknown_assets(allow_unknown_assets);
    let (catalogue, tolerances) = (Catalogue::bundled(), Tolerances { touch_m, rest_m });
    let found =
        py.detach(|| inspect_houses(&source.inner, &stage.inner, catalogue, unknown, tolerances));
    Ok(serde_json::json!(found.map_err(error::to_py)?).to_string())
}
