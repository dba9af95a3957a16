//! Whether a changed house is one that physics allows.

mod findings;
mod solid;

pub use findings::{Finding, FindingKind, Inspector, Tolerances, inspect, inspect_houses};
