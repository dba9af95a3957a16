//! A house of 100 objects into a world: whole, and after five of them moved.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use evonav_core::{
    assets::{Catalogue, UnknownAssets, shapes::shape_of},
    house::House,
    world::{
        inspection::{Tolerances, inspect},
        scene::Scene,
    },
};

const HOUSE: &str = include_str!("../../evonav-core/tests/data/house_100_objects.json");

fn bench_scene(c: &mut Criterion) {
    let house = House::from_json("house", HOUSE).expect("a valid house");
    let catalogue = Catalogue::bundled();
    let unknown = UnknownAssets::Error;
    let scene = Scene::build(&house, catalogue, unknown).expect("known assets");
    let moved: Vec<usize> = (house.objects.len() - 5..house.objects.len()).collect();
    c.bench_function("scene/load_100_objects", |b| {
        b.iter(|| {
            let house = House::from_json("house", black_box(HOUSE))?;
            Scene::build(&house, catalogue, unknown)
        });
    });
    c.bench_function("scene/build_100_objects", |b| {
        b.iter(|| Scene::build(black_box(&house), catalogue, unknown));
    });
    c.bench_function("scene/rebuild_5_of_100_objects", |b| {
        b.iter(|| scene.rebuild(black_box(&house), catalogue, unknown, &moved));
    });
    c.bench_function("scene/inspect_100_objects", |b| {
        let tolerances = Tolerances { touch_m: 0.0025, rest_m: 0.02 };
        b.iter(|| inspect((&house, &scene), (black_box(&house), &scene), tolerances));
    });
    c.bench_function("scene/shapes_of_all_assets", |b| {
        let ids = catalogue.asset_ids();
        b.iter(|| {
            let assets = ids.iter().filter_map(|id| catalogue.get(id));
            assets.map(|asset| shape_of(asset).len()).sum::<usize>()
        });
    });
}

criterion_group!(benches, bench_scene);
criterion_main!(benches);
