//! The one error type of the crate.

use thiserror::Error as ThisError;

/// Everything that can go wrong on data that a user supplies. The bindings map each variant to one
/// Python exception.
#[derive(Debug, Clone, PartialEq, ThisError)]
pub enum Error {
    /// A house file is malformed, or contradicts itself.
    #[error("house {house}: {object}: field `{field}`: {message}")]
    House {
        /// Name of the file, or the name the caller gave.
        house: String,
        /// Id of the object, wall, room ..., or its place in the file, for example `objects[3]`.
        object: String,
        /// JSON field; nested names are joined by dots.
        field: String,
        /// Description of the error, with the value found.
        message: String,
    },
    /// The simulator cannot do what was asked in this house.
    #[error("simulation: {message}")]
    Simulation {
        /// The request, and why it cannot be carried out.
        message: String,
    },
    /// An argument is outside its domain.
    #[error("argument `{name}` is {value}, expected {expected}")]
    InvalidArgument {
        /// Name of the parameter, as in the public signature.
        name: String,
        /// Value found.
        value: String,
        /// Allowed values.
        expected: String,
    },
}

impl Error {
    /// Check one scalar argument.
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

    /// Check that numbers are finite.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] naming the argument and the first value that is not.
    pub fn require_finite(name: &str, values: &[f64]) -> Result<(), Self> {
        values.iter().try_for_each(|&value| Self::require(name, value, "finite", f64::is_finite))
    }

    /// Check that an image has whole rows of pixels.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] naming the argument and its number of pixels.
    pub fn require_rows(name: &str, num_px: usize, width_px: usize) -> Result<(), Self> {
        Self::require(name, num_px, "whole rows of pixels", |num_px| {
            width_px > 0 && num_px.is_multiple_of(width_px)
        })
    }

    /// Create an [`Error::InvalidArgument`].
    pub fn invalid(name: &str, value: impl ToString, expected: &str) -> Self {
        Self::InvalidArgument {
            name: name.to_owned(),
            value: value.to_string(),
            expected: expected.to_owned(),
        }
    }
}
