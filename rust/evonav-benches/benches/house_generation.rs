//! Houses from seeds, with the mix of ProcTHOR's room specs.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use evonav_core::house_generation::{HouseMaker, HouseParameters};

/// Number of houses in one measurement, so that their sizes even out.
const NUM_HOUSES: u64 = 50;

fn bench_houses(c: &mut Criterion) {
    let maker = HouseMaker::new(HouseParameters::default()).expect("valid parameters");
    let mut group = c.benchmark_group("house_generation");
    group.sample_size(10);
    group.bench_function("50_houses", |b| {
        b.iter(|| {
            for index in 0..NUM_HOUSES {
                black_box(maker.make(1, index).expect("a house"));
            }
        });
    });
    group.finish();
}

criterion_group!(benches, bench_houses);
criterion_main!(benches);
