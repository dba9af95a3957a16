//! Python bindings of `evonav-core`: they convert, release the GIL and map errors, nothing else.

mod arrays;
mod batch;
mod camera;
mod error;
mod evolution;
mod house;
mod inspect;
mod memory;
mod nn;
mod noise;
mod objects;
mod planning;
mod sensors;
mod simulator;
mod snapshots;

use pyo3::prelude::*;

#[pymodule]
fn _core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    error::register(module)?;
    house::register(module)?;
    inspect::register(module)?;
    sensors::register(module)?;
    noise::register(module)?;
    memory::register(module)?;
    nn::register(module)?;
    planning::register(module)?;
    camera::register(module)?;
    simulator::register(module)?;
    batch::register(module)?;
    snapshots::register(module)?;
    evolution::register(module)?;
    // PyO3 lists every name in `__all__`, which the stub would have to repeat.
    module.delattr("__all__")
}
