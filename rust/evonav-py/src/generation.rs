//! Task generation.

use evonav_core::{
    assets::Catalogue,
    generation::{self, Generation, Overrides, Parameters},
};
use pyo3::{prelude::*, types::PyBytes};

use crate::{
    error,
    house::{House, unknown_assets},
};

/// JSON of the record, stage houses, and reference images (RGB, row by row).
type Generated<'py> = (String, Vec<String>, Vec<Bound<'py, PyBytes>>);

/// Generate a task. Units and errors: `_core.pyi` and
/// `evonav_core::generation::generate_task`.
#[pyfunction]
#[pyo3(signature = (house, *, seed, label, parameters_json, allow_unknown_assets, given_json="{}"))]
pub fn generate_task<'py>(
    py: Python<'py>,
    house: &House,
    seed: u64,
    label: &str,
    parameters_json: &str,
    allow_unknown_assets: bool,
    given_json: &str,
) -> PyResult<Generated<'py>> {
    let unknown = unknown_assets(allow_unknown_assets);
    let (json, generated) = py
        .detach(|| {
            let parameters = Parameters::from_json(parameters_json)?;
            let given = Overrides::from_json(given_json)?;
            let (house, catalogue) = (&house.inner, Catalogue::bundled());
            generation::generate_task(house, catalogue, unknown, seed, label, &parameters, &given)
                .map(|generated| (generated.to_json(), generated))
        })
        .map_err(error::to_py)?;
    let (houses, images) = match generated {
        Generation::Task(task) => (task.houses, task.images),
        Generation::Rejected(_) => (Vec::new(), Vec::new()),
    };
    Ok((json, houses, images.iter().map(|image| PyBytes::new(py, image)).collect()))
}

/// Return the paper's parameters as JSON; Python takes its defaults from them.
#[pyfunction]
pub fn default_generation_parameters() -> String {
    Parameters::default().to_json()
}
