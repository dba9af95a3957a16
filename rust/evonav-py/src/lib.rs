//! Python bindings of `evonav-core`. They convert arguments, release the GIL and map errors, and do
//! nothing else.

mod arrays;
mod camera;
mod error;
mod generation;
mod house;
mod inspection;
mod memory;
mod perception;
mod sensors;
mod simulator;
mod unigoal;

use pyo3::prelude::*;

#[pymodule]
fn _core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    error::register(module)?;
    house::register(module)?;
    inspection::register(module)?;
    sensors::register(module)?;
    camera::register(module)?;
    perception::register(module)?;
    memory::register(module)?;
    unigoal::register(module)?;
    simulator::register(module)?;
    generation::register(module)?;
    // PyO3 lists every name in `__all__`, which the stub would have to repeat.
    module.delattr("__all__")
}
