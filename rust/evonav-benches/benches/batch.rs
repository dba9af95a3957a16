//! Sixteen agents in a house of 100 objects: what a step of a vector environment costs.

use std::{hint::black_box, sync::Arc};

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use evonav_core::{
    assets::UnknownAssets,
    geometry::{Pose, Vec2},
    house::House,
    sensors::{instance_masks::MaskFilter, raster::Style},
    simulator::{
        EmbeddedSimulator, SimulatorConfig,
        actions::Strides,
        batch::{Batch, BatchConfig, Images},
        batch_slot::Slot,
        geodesic_field::GeodesicField,
    },
    world::navigation::AgentBody,
};

const HOUSE: &str = include_str!("../../evonav-core/tests/data/house_100_objects.json");
const NUM_SLOTS: usize = 16;
const IMAGE_PX: [usize; 2] = [128, 128];

fn world() -> Arc<EmbeddedSimulator> {
    let config = SimulatorConfig {
        image_px: IMAGE_PX,
        vertical_fov_rad: std::f64::consts::FRAC_PI_2,
        clip_m: [0.1, 20.0],
        camera_height_m: 1.575,
        agent: AgentBody { radius_m: 0.2, height_m: 1.8 },
        unknown: UnknownAssets::Error,
        style: Style::Plain,
    };
    let house = House::from_json("house", HOUSE).expect("a valid house");
    Arc::new(EmbeddedSimulator::new(house, config).expect("a usable house"))
}

fn places_m(world: &EmbeddedSimulator) -> Vec<Vec2> {
    let [x, _, z] = world.start().position_m;
    let all_m = world.navigation().reachable_positions([x, z], 0.25).expect("a grid");
    (0..NUM_SLOTS).map(|i| all_m[i * all_m.len() / NUM_SLOTS]).collect()
}

fn batch(world: &Arc<EmbeddedSimulator>, num_threads: usize) -> Batch {
    let config = BatchConfig {
        image_px: IMAGE_PX,
        empty_depth_m: 20.0,
        strides: Strides { move_m: 0.25, turn_rad: std::f64::consts::FRAC_PI_6 },
        grid_m: 0.25,
        mask_filter: MaskFilter { min_area_px: 25, max_box_fraction: 1.0 },
        num_threads,
        min_shared_px: 0,
    };
    let mut batch = Batch::new(NUM_SLOTS, config).expect("a valid batch");
    let [x, _, z] = world.start().position_m;
    let field = Arc::new(GeodesicField::new(Arc::clone(world), [x, z]).expect("a free goal"));
    let labels: Arc<[u8]> = vec![1; world.bodies().len()].into();
    for (index, point_m) in places_m(world).into_iter().enumerate() {
        let pose = Pose {
            position_m: world.body_position_m(point_m),
            yaw_rad: index as f64 * 0.7,
            horizon_rad: 0.5,
        };
        let slot = Slot::new(Arc::clone(world), pose, Arc::clone(&labels));
        batch.place(index, slot).expect("a slot");
        batch.aim(index, Some(Arc::clone(&field))).expect("a slot");
    }
    batch
}

fn bench_batch(c: &mut Criterion) {
    let world = world();
    let num_pixels = NUM_SLOTS * IMAGE_PX[0] * IMAGE_PX[1];
    let (mut depth_m, mut rgb) = (vec![0.0_f32; num_pixels], vec![0_u8; 3 * num_pixels]);
    for num_threads in [1, 2] {
        let drawn = batch(&world, num_threads);
        c.bench_function(&format!("batch/depth_16x128x128_{num_threads}_threads"), |b| {
            let mut render =
                || drawn.render(Images { depth_m: Some(&mut depth_m), ..Images::default() });
            b.iter(&mut render);
        });
        c.bench_function(&format!("batch/rgb_16x128x128_{num_threads}_threads"), |b| {
            let mut render = || drawn.render(Images { rgb: Some(&mut rgb), ..Images::default() });
            b.iter(&mut render);
        });
    }
    // All forwards, then all around: agents end up before walls as they do in training.
    let mut stepped = batch(&world, 1);
    let mut number = 0_usize;
    c.bench_function("batch/step_16", |b| {
        b.iter(|| {
            number += 1;
            stepped.step(&[if number % 5 < 3 { 0 } else { 2 }; NUM_SLOTS])
        });
    });
}

fn bench_field(c: &mut Criterion) {
    let world = world();
    let places_m = places_m(&world);
    let new = || GeodesicField::new(Arc::clone(&world), places_m[0]);
    let field = new().expect("a free goal");
    c.bench_function("field/new", |b| b.iter_batched(|| (), |()| new(), BatchSize::SmallInput));
    let mut next = places_m.iter().cycle();
    c.bench_function("field/distance", |b| {
        b.iter(|| next.next().map(|&point_m| field.distance_m(black_box(point_m))));
    });
    // The twin: a whole search from the goal for one distance.
    let mut next = places_m.iter().cycle();
    c.bench_function("field/distance_by_search", |b| {
        b.iter(|| {
            let point_m = *next.next().unwrap_or(&[0.0; 2]);
            world.navigation().distances_m(places_m[0], black_box(&[point_m]))
        });
    });
}

criterion_group!(benches, bench_batch, bench_field);
criterion_main!(benches);
