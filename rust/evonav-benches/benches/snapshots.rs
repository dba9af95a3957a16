//! Snapshots at the size of a task's end: 100 objects, 600 frames.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use evonav_core::{
    memory::snapshots::{Frame, Located, update_snapshots},
    rng::Stream,
};

fn bench_snapshots(c: &mut Criterion) {
    let mut stream = Stream::new(1, &["bench"]);
    let objects: Vec<Located> = (0..100)
        .map(|id| Located { id, centre_m: [16.0 * stream.uniform(), 12.0 * stream.uniform()] })
        .collect();
    // What stands within 3.5 m ahead of a place, as a view of 90 degrees shows it.
    let frames: Vec<Frame> = (0..600)
        .map(|_| {
            let [x, z] = [16.0 * stream.uniform(), 12.0 * stream.uniform()];
            let yaw = std::f64::consts::TAU * stream.uniform();
            let is_seen = |o: &&Located| {
                let (dx, dz) = (o.centre_m[0] - x, o.centre_m[1] - z);
                let ahead = dx * yaw.sin() + dz * yaw.cos();
                dx.hypot(dz) < 3.5 && ahead > 0.7 * dx.hypot(dz)
            };
            Frame { seen: objects.iter().filter(is_seen).map(|o| (o.id, 1.0)).collect() }
        })
        .collect();
    let update = |snapshots: &[_], reach_m| {
        update_snapshots(&objects, &frames, snapshots, black_box([8.0, 6.0]), reach_m)
            .expect("valid input")
    };
    let snapshots = update(&[], 4.0);
    c.bench_function("snapshots/anew_100_objects_600_frames", |b| b.iter(|| update(&[], 4.0)));
    c.bench_function("snapshots/update_100_objects_600_frames", |b| {
        b.iter(|| update(&snapshots, 4.0));
    });
}

criterion_group!(benches, bench_snapshots);
criterion_main!(benches);
