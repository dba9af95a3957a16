//! A task from a house of 100 objects, and its dearest step: moving everything in a room.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use evonav_core::{
    assets::{Catalogue, UnknownAssets},
    generation::{Extensions, Occurrence, Overrides, Parameters, Schedule, generate_task},
    house::House,
    world::{
        layout::{SpawnRequest, random_spawn},
        scene::Scene,
    },
};

const HOUSE: &str = include_str!("../../evonav-core/tests/data/house_100_objects.json");

fn bench_generation(c: &mut Criterion) {
    let house = House::from_json("house_100_objects", HOUSE).expect("a valid house");
    let papers = Parameters { num_stages: vec![4], ..Parameters::default() };
    let [retaining, shuffling] = [[1.0, 0.0], [0.0, 1.0]].map(|[retain, shuffle]| Parameters {
        evolve_probability: 1.0,
        salient_object_probability: 0.0,
        retain_group_probability: retain,
        full_shuffle_probability: shuffle,
        ..papers.clone()
    });
    let often = Some(Occurrence { probability: 1.0, max_count: 3 });
    let extended = Extensions {
        insertion: often,
        removal: often,
        doors: often,
        openables: often,
        switches: often,
        schedule: None,
        during_stage: None,
    };
    let people = Schedule { num_persons: 3, minutes_between_stages: 180, tidiness: 0.8 };
    let people = Extensions { schedule: Some(people), ..Extensions::default() };
    let extended = Parameters { extensions: extended, ..papers.clone() };
    let lived_in = Parameters { extensions: people, ..papers.clone() };
    for (name, parameters) in [
        ("papers", papers),
        ("retain_group", retaining),
        ("full_shuffle", shuffling),
        ("extensions", extended),
        ("schedule", lived_in),
    ] {
        let (mut seed, nothing) = (0, Overrides::default());
        c.bench_function(&format!("generate_task/4_stages_{name}"), |b| {
            b.iter(|| {
                seed += 1;
                let catalogue = Catalogue::bundled();
                let unknown = UnknownAssets::Error;
                generate_task(
                    black_box(&house),
                    catalogue,
                    unknown,
                    seed,
                    "bench",
                    &parameters,
                    &nothing,
                )
            });
        });
    }
}

/// AI2-THOR's `InitialRandomSpawn` of everything that can be carried.
fn bench_random_spawn(c: &mut Criterion) {
    let house = House::from_json("house_100_objects", HOUSE).expect("a valid house");
    let (catalogue, unknown) = (Catalogue::bundled(), UnknownAssets::Error);
    let scene = Scene::build(&house, catalogue, unknown).expect("known assets");
    let mut request =
        SpawnRequest::from_json(r#"{"seed": 0, "num_attempts": 5}"#).expect("a sound request");
    c.bench_function("random_spawn/house_100_objects", |b| {
        b.iter(|| {
            request.seed += 1;
            random_spawn(black_box(&house), catalogue, unknown, &scene, &request)
        });
    });
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(10);
    targets = bench_generation, bench_random_spawn
}
criterion_main!(benches);
