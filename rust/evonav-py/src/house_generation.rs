//! Houses from seeds.

use evonav_core::house_generation::{self, HouseParameters};
use pyo3::prelude::*;

use crate::error;

/// Makes houses. Parameters and errors: `_core.pyi` and `evonav_core::house_generation`.
#[pyclass(frozen, module = "evonav._core")]
pub struct HouseMaker {
    inner: house_generation::HouseMaker,
}

#[pymethods]
impl HouseMaker {
    #[new]
    fn new(parameters_json: &str) -> PyResult<Self> {
        let inner = HouseParameters::from_json(parameters_json)
            .and_then(house_generation::HouseMaker::new)
            .map_err(error::to_py)?;
        Ok(Self { inner })
    }

    fn make(&self, py: Python<'_>, seed: u64, index: u64) -> PyResult<String> {
        let made = py.detach(|| self.inner.make(seed, index).map(|house| house.to_json()));
        made.map_err(error::to_py)
    }
}

/// Return ProcTHOR's parameters of houses as JSON.
#[pyfunction]
pub fn default_house_parameters() -> String {
    HouseParameters::default().to_json()
}
