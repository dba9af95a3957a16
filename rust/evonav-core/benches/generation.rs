//! A task from a house of 100 objects, and its dearest step: moving everything in a room.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use evonav_core::{
    assets::{Catalogue, UnknownAssets},
    evolution::{Parameters, generate_task},
    house::House,
};

const HOUSE: &str = include_str!("../tests/data/house_100_objects.json");

fn bench_generation(c: &mut Criterion) {
    let house = House::from_json("house_100_objects", HOUSE).expect("a valid house");
    let papers = Parameters { num_stages: vec![4], ..Parameters::default() };
    let shuffling = Parameters {
        evolve_probability: 1.0,
        salient_object_probability: 0.0,
        retain_group_probability: 0.0,
        ..papers.clone()
    };
    for (name, parameters) in [("papers", papers), ("full_shuffle", shuffling)] {
        let mut seed = 0;
        c.bench_function(&format!("generate_task/4_stages_{name}"), |b| {
            b.iter(|| {
                seed += 1;
                let catalogue = Catalogue::bundled();
                let unknown = UnknownAssets::Error;
                generate_task(black_box(&house), catalogue, unknown, seed, "bench", &parameters)
            });
        });
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(10);
    targets = bench_generation
}
criterion_main!(benches);
