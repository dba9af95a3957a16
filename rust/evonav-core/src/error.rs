//! The one error type of the crate.

use thiserror::Error as ThisError;

/// Everything that can go wrong on data a user supplies. Bindings map each variant to one
/// Python exception.
#[derive(Debug, Clone, PartialEq, ThisError)]
pub enum Error {
    /// A house file is malformed, or contradicts itself.
    #[error("house {house}: {object}: field `{field}`: {message}")]
    House {
        /// Name of the file, or the name the caller gave.
        house: String,
        /// Id of the object, wall, room ... or its place in the file, such as `objects[3]`.
        object: String,
        /// JSON field, dotted.
        field: String,
        /// What is wrong, with the value found.
        message: String,
    },
    /// The simulator cannot do what was asked in this house.
    #[error("simulation: {message}")]
    Simulation {
        /// What was asked, and why it cannot be done.
        message: String,
    },
    /// An argument is outside its domain.
    #[error("argument `{name}` is {value}, expected {expected}")]
    InvalidArgument {
        /// Parameter's name, as in the public signature.
        name: String,
        /// Value found.
        value: String,
        /// Domain, in words.
        expected: String,
    },
}

impl Error {
    /// Checks one scalar argument.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] naming the argument, its value and `expected` if `is_valid` is false for it.
    pub fn require<T: Copy + ToString>(
        name: &str,
        value: T,
        expected: &str,
        is_valid: impl Fn(T) -> bool,
    ) -> Result<(), Self> {
        if is_valid(value) {
            return Ok(());
        }
        Err(Self::invalid(name, value, expected))
    }

    /// An [`Error::InvalidArgument`].
    pub fn invalid(name: &str, value: impl ToString, expected: &str) -> Self {
        Self::InvalidArgument {
            name: name.to_owned(),
            value: value.to_string(),
            expected: expected.to_owned(),
        }
    }
}
