//! Fuzz `targets::weights`.
#![no_main]

use evonav_fuzz::{fuzz, json, targets};
use libfuzzer_sys::{Corpus, fuzz_mutator, fuzz_target};

fuzz_target!(|data: &[u8]| -> Corpus { fuzz(targets::weights, data) });
fuzz_mutator!(|data: &mut [u8], size: usize, max_size: usize, seed: u32| {
    json::mutate_weights(data, size, max_size, seed)
});
