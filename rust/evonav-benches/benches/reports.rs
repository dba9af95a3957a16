//! What reports compute most often: resamples of 1,000 houses, a house's outlines, a room's label.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use evonav_core::{
    drawing::{label_point::label_point, outline::outline},
    resampling::{Pcg64, draw_counts},
};

fn bench_reports(c: &mut Criterion) {
    let mut source = Pcg64 { state: 1, increment: 1 };
    let mut counts = vec![0; 100 * 1000];
    c.bench_function("resampling/100_resamples_1000_clusters", |b| {
        b.iter(|| draw_counts(&mut source, black_box(&mut counts), 1000));
    });
    let room = [[0.0, 0.0], [0.0, 4.0], [3.0, 4.0], [3.0, 6.0], [6.0, 6.0], [6.0, 0.0]];
    let taken: Vec<_> =
        (0..15).map(|i| f64::from(i) * 0.35).map(|at| [at, 5.0 - at, at + 0.8, 5.5 - at]).collect();
    c.bench_function("drawing/label_of_a_room_with_15_objects", |b| {
        b.iter(|| label_point(black_box(&room), 24, &taken, [1.2, 0.4]));
    });
    c.bench_function("drawing/outline_of_6_corners", |b| b.iter(|| outline(black_box(&room))));
}

criterion_group!(benches, bench_reports);
criterion_main!(benches);
