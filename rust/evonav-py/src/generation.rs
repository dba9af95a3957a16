//! Task generation.

use evonav_core::{
    assets::{Catalogue, UnknownAssets},
    generation::{Generation, Overrides, Parameters, generate_with_overrides},
};
use pyo3::{prelude::*, types::PyBytes};

use crate::{error, house::House};

/// JSON of the record, stage houses, and reference images (RGB, row by row).
type Generated<'py> = (String, Vec<String>, Vec<Bound<'py, PyBytes>>);

/// Generate a task. Units and errors: `_core.pyi` and
/// `evonav_core::generation::generate_with_overrides`.
#[pyfunction]
#[pyo3(signature = (house, *, seed, label, parameters_json, allow_unknown_assets, given_json="{}"))]
fn generate_task<'py>(
    py: Python<'py>,
    house: &House,
    seed: u64,
    label: &str,
    parameters_json: &str,
    allow_unknown_assets: bool,
    given_json: &str,
) -> PyResult<Generated<'py>> {
    let unknown =
        if allow_unknown_assets { UnknownAssets::CategoryDefault } else { UnknownAssets::Error };
    let (json, generated) = py
        .detach(|| {
            let parameters = Parameters::from_json(parameters_json)?;
            let given = Overrides::from_json(given_json)?;
            let (house, catalogue) = (&house.inner, Catalogue::bundled());
            generate_with_overrides(house, catalogue, unknown, seed, label, &parameters, &given)
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
fn default_generation_parameters() -> String {
    Parameters::default().to_json()
}

/// Add the functions to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(default_generation_parameters, module)?)?;
    module.add_function(wrap_pyfunction!(generate_task, module)?)
}
