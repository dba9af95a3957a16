//! The small detector and simulated errors.

mod mini;
mod simulated_errors;
