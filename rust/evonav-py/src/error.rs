//! The Python exceptions and the one place that maps core errors to them.

use evonav_core::Error;
use pyo3::{create_exception, exceptions::PyException, prelude::*};

create_exception!(
    evonav._core,
    EvonavError,
    PyException,
    "The root of all errors that evonav raises; each says what is wrong and what to do.

Examples:
    >>> import evonav
    >>> try:
    ...     evonav.load_tasks('nowhere')
    ... except evonav.EvonavError as error:
    ...     print(error)
    nowhere: no such folder of tasks; `bundled` names those of evonav
"
);
create_exception!(evonav._core, HouseError, EvonavError, "A house file is malformed.");
create_exception!(evonav._core, TaskError, EvonavError, "A task is malformed or cannot be made.");
create_exception!(evonav._core, SimulationError, EvonavError, "The simulator cannot do this.");
create_exception!(evonav._core, DecisionError, EvonavError, "No usable decision was made.");
create_exception!(evonav._core, StoreError, EvonavError, "A results store cannot be used.");
create_exception!(
    evonav._core,
    InvalidArgumentError,
    EvonavError,
    "An argument is outside its domain."
);

/// Return the Python exception for a core error.
pub fn to_py(error: Error) -> PyErr {
    let message = error.to_string();
    match error {
        Error::House { .. } => HouseError::new_err(message),
        Error::Simulation { .. } => SimulationError::new_err(message),
        Error::InvalidArgument { .. } => InvalidArgumentError::new_err(message),
    }
}
