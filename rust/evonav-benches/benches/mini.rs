//! The mini detector on one view.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use evonav_core::perception::mini::{
    detector::{DetectorConfig, detect},
    instances::{Resemblance, refine, segments},
    network::{Network, input},
};

const WEIGHTS: &[u8] = include_bytes!("../../../python/evonav/data/mini.weights");
const SIZE_PX: [usize; 2] = [300, 300];

/// A picture of coloured tiles at different depths: the network's work does not depend on it.
fn picture() -> (Vec<u8>, Vec<f32>) {
    let tile = |p: usize| (p / SIZE_PX[0] / 30 * 10 + p % SIZE_PX[0] / 30) as u8;
    let pixels = 0..SIZE_PX[0] * SIZE_PX[1];
    let rgb = pixels.clone().flat_map(|p| [tile(p).wrapping_mul(37), tile(p), 255 - tile(p)]);
    (rgb.collect(), pixels.map(|p| 1.0 + f32::from(tile(p)) / 25.0).collect())
}

fn stages(criterion: &mut Criterion) {
    let network = Network::read(WEIGHTS).expect("the shipped weights");
    let (rgb, depth_m) = picture();
    let resemblance = Resemblance::default();
    let config = DetectorConfig { min_cells: 2, min_confidence: 0.1, resemblance };
    let made = input(&rgb, &depth_m, SIZE_PX, 0.5).expect("a picture");
    let logits = network.run(&made).expect("an input");
    let found = segments(&logits, 2, 0.1).expect("logits");
    criterion.bench_function("mini/input", |b| {
        b.iter(|| input(black_box(&rgb), black_box(&depth_m), SIZE_PX, 0.5));
    });
    criterion.bench_function("mini/network", |b| b.iter(|| network.run(black_box(&made))));
    criterion.bench_function("mini/segments", |b| b.iter(|| segments(black_box(&logits), 2, 0.1)));
    criterion.bench_function("mini/outlines", |b| {
        b.iter(|| refine(black_box(&found.cells), &rgb, &depth_m, SIZE_PX, resemblance));
    });
    criterion.bench_function("mini/view", |b| {
        b.iter(|| detect(&network, black_box(&rgb), black_box(&depth_m), SIZE_PX, 0.5, &config));
    });
}

criterion_group!(benches, stages);
criterion_main!(benches);
