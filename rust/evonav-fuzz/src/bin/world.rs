//! Fuzz `targets::world`.
#![no_main]

use evonav_fuzz::{
    fuzz,
    json::{self, Way},
    targets,
};
use libfuzzer_sys::{Corpus, fuzz_mutator, fuzz_target};

fuzz_target!(|data: &[u8]| -> Corpus { fuzz(targets::world, data) });
fuzz_mutator!(|data: &mut [u8], size: usize, max_size: usize, seed: u32| {
    json::mutate(data, size, max_size, seed, Way::Tame)
});
