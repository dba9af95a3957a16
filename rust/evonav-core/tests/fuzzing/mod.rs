//! Bytes that fuzzers have found, and those with which they begin: `tests/data/fuzzing`.

mod targets;

use std::{fs, path::Path};

use targets::TARGETS;

#[test]
fn what_a_fuzzer_has_found_is_mended() {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/fuzzing");
    for (name, run) in TARGETS {
        let files = fs::read_dir(corpus.join(name)).expect("a folder for each target");
        let mut num_run = 0;
        for file in files {
            let path = file.expect("a file").path();
            let data = fs::read(&path).expect("a readable file");
            let is_run = std::panic::catch_unwind(|| run(&data));
            num_run += usize::from(is_run.unwrap_or_else(|_| panic!("{}", path.display())));
        }
        assert!(num_run > 0, "nothing is run by {name}");
    }
}
