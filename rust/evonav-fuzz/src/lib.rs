//! The targets of the fuzzers, which an ordinary test of evonav-core runs too, and mutation of JSON.

pub mod json;
#[path = "../../evonav-core/tests/fuzzing/targets.rs"]
pub mod targets;

use libfuzzer_sys::Corpus;

/// Run a target.
pub fn fuzz(target: fn(&[u8]) -> bool, data: &[u8]) -> Corpus {
    if target(data) { Corpus::Keep } else { Corpus::Reject }
}
