//! Bytes that fuzzers have found, and those with which they begin: `tests/data/fuzzing`.

mod targets;

use std::{fs, path::Path};

use targets::TARGETS;

#[test]
fn what_fuzzers_found_is_mended() {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/fuzzing");
    for (name, run) in TARGETS {
        let files = fs::read_dir(corpus.join(name)).expect("a folder for each target");
        let mut num_files = 0;
        for file in files {
            let path = file.expect("a file").path();
            println!("{}", path.display());
            run(&fs::read(&path).expect("a readable file"));
            num_files += 1;
        }
        assert!(num_files > 0, "no file for {name}");
    }
}

#[test]
fn the_smallest_houses_are_read() {
    use evonav_core::house::House;
    House::from_json("two rooms", targets::TWO_ROOMS).expect("a house");
}
