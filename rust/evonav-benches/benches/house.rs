//! Loading a house of 100 objects: the document, the assets of its objects, a world of it, and a change to it.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use evonav_core::{
    Error,
    assets::{Asset, Catalogue, UnknownAssets},
    house::{House, HouseDelta, ObjectMove},
    world::{
        mesh::SceneMesh,
        navigation::{AgentBody, Navigation, NavigationConfig},
        scene::Scene,
    },
};

const HOUSE: &str = include_str!("../../evonav-core/tests/data/house_100_objects.json");

fn bench_house(c: &mut Criterion) {
    let house = House::from_json("house", HOUSE).expect("a valid house");
    let catalogue = Catalogue::bundled();
    let moves = house.objects.iter().rev().take(5).map(|object| ObjectMove {
        id: object.id.clone(),
        position_m: object.position_m,
        rotation_deg: object.rotation_deg,
        parent: None,
    });
    let delta = HouseDelta { moves: moves.collect(), ..HouseDelta::default() };
    // The yardstick: JSON to a tree and nothing else.
    c.bench_function("house/serde_json_value", |b| {
        b.iter(|| serde_json::from_str::<serde_json::Value>(black_box(HOUSE)));
    });
    c.bench_function("house/from_json", |b| b.iter(|| House::from_json("house", black_box(HOUSE))));
    c.bench_function("house/assets", |b| {
        b.iter(|| {
            let assets = house.objects.iter();
            assets
                .map(|object| catalogue.asset_of(&house, black_box(object), UnknownAssets::Error))
                .collect::<Result<Vec<Asset>, _>>()
        });
    });
    // Everything a simulator holds once a house is loaded; the aim is 20 ms.
    c.bench_function("house/into_world", |b| {
        b.iter(|| {
            let house = House::from_json("house", black_box(HOUSE))?;
            let scene = Scene::build(&house, catalogue, UnknownAssets::Error)?;
            let mesh = SceneMesh::build(&scene);
            let navigation =
                Navigation::build(&scene, AgentBody::DEFAULT, NavigationConfig::default())?;
            Ok::<_, Error>((house, scene, mesh, navigation))
        });
    });
    c.bench_function("house/to_json", |b| b.iter(|| black_box(&house).to_json()));
    c.bench_function("house/apply_5_moves", |b| b.iter(|| house.apply(black_box(&delta))));
}

criterion_group!(benches, bench_house);
criterion_main!(benches);
