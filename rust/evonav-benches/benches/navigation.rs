//! Navigation in a real 100-object house: building, flood fill, paths cold and warm.

use std::hint::black_box;

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use evonav_core::{
    assets::{Catalogue, UnknownAssets},
    geometry::Vec2,
    house::House,
    rng::Stream,
    world::{
        navigation::{AgentBody, Navigation, NavigationConfig},
        scene::Scene,
    },
};

fn bench_navigation(c: &mut Criterion) {
    let json = include_str!("../../evonav-core/tests/data/house_100_objects.json");
    let house = House::from_json("house_100_objects", json).expect("a valid house");
    let scene = Scene::build(&house, Catalogue::bundled(), UnknownAssets::Error).expect("a scene");
    let build = || {
        Navigation::build(&scene, AgentBody::DEFAULT, NavigationConfig::default())
            .expect("sound geometry")
    };
    let navigation = build();
    let start = house.start.expect("a start").position_m;
    let start_m = [start[0], start[2]];
    let reached = navigation.reachable_positions(start_m, 0.25).expect("a grid");
    let mut rng = Stream::new(0, &["pairs"]);
    let pairs: Vec<[Vec2; 2]> =
        (0..100).map(|_| [0; 2].map(|_| reached[rng.below(reached.len())])).collect();
    let all_paths = |navigation: &Navigation| {
        pairs.iter().filter_map(|&[a, b]| navigation.shortest_path(a, b)).count()
    };

    c.bench_function("navigation/build", |b| b.iter(build));
    c.bench_function("navigation/reachable_positions", |b| {
        b.iter(|| navigation.reachable_positions(black_box(start_m), 0.25));
    });
    c.bench_function("navigation/100_paths_cold", |b| {
        b.iter_batched(build, |cold| all_paths(&cold), BatchSize::SmallInput);
    });
    all_paths(&navigation);
    c.bench_function("navigation/100_paths_warm", |b| b.iter(|| all_paths(&navigation)));
    c.bench_function("navigation/distances_to_all_reachable", |b| {
        b.iter(|| navigation.distances_m(black_box(start_m), &reached));
    });
    let spec = navigation.map_spec(0.1).expect("a map");
    c.bench_function("navigation/occupancy_0.1m", |b| {
        b.iter(|| navigation.occupancy(&spec, black_box(start_m)));
    });
}

criterion_group!(benches, bench_navigation);
criterion_main!(benches);
