//! Checks whether a changed house is physically possible.

mod findings;
mod solid;

pub use findings::{Finding, FindingKind, Inspector, Tolerances, inspect, inspect_houses};
