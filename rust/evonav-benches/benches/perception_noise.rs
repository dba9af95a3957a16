//! What simulated errors cost a view, beside numbering its detections.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use evonav_core::{
    perception::{
        depth_noise::{DepthNoise, noisy_depth},
        false_detections::{SiteNoise, surface_sites},
        mask_distortion::{MaskChange, distort_masks},
        mask_outlines::mask_outlines,
    },
    rng::Stream,
    sensors::{
        camera::Camera,
        instance_masks::{MaskFilter, number_instances},
        runs::RunImage,
    },
};

const SIDE_PX: usize = 300;

/// Twenty discs over one another on a floor that recedes.
fn view() -> (Vec<i32>, Vec<f32>) {
    let mut masks = vec![-1; SIDE_PX * SIDE_PX];
    let mut stream = Stream::new(1, &["bench"]);
    for mask in 0..20 {
        let [row, col, radius] = [SIDE_PX, SIDE_PX, 40].map(|bound| stream.below(bound) as i64);
        for (index, pixel) in masks.iter_mut().enumerate() {
            let (down, right) = (index as i64 / 300 - row, index as i64 % 300 - col);
            if down * down + right * right <= (radius + 8).pow(2) {
                *pixel = mask;
            }
        }
    }
    let depth_m = (0..masks.len()).map(|index| 6.0 - 5.0 * (index / SIDE_PX) as f32 / 300.0);
    (masks, depth_m.collect())
}

fn bench_noise(c: &mut Criterion) {
    let (masks, depth_m) = view();
    let instances: Vec<i32> = masks.iter().map(|mask| mask + 1).collect();
    c.bench_function("noise/ground_truth_300x300", |b| {
        let filter = MaskFilter { min_area_px: 90, max_box_fraction: 1.0 };
        b.iter(|| {
            let instances = RunImage::of(black_box(&instances), SIDE_PX).expect("whole rows");
            number_instances(&instances, &[true; 20], filter)
        });
    });
    c.bench_function("noise/outlines_300x300", |b| {
        b.iter(|| mask_outlines(black_box(&masks), &depth_m, SIDE_PX, 20));
    });
    let mut changes: Vec<_> = (0..20).map(MaskChange::renamed).collect();
    for (number, change) in changes.iter_mut().enumerate() {
        change.margin_px = number as f64 / 4.0 - 2.5;
    }
    c.bench_function("noise/distort_300x300", |b| {
        b.iter(|| distort_masks(black_box(&masks), SIDE_PX, &changes));
    });
    let noise = DepthNoise {
        sigma_m: 0.001,
        sigma_per_m: 0.0014,
        step_per_m: 0.0028,
        dropout: 0.02,
        edge_dropout: 0.5,
        max_depth_m: 5.0,
    };
    c.bench_function("noise/depth_300x300", |b| {
        b.iter(|| noisy_depth(black_box(&depth_m), SIDE_PX, &noise, &Stream::new(1, &["depth"])));
    });
    let camera = Camera {
        width_px: SIDE_PX,
        height_px: SIDE_PX,
        vertical_fov_rad: std::f64::consts::FRAC_PI_2,
        position_m: [3.0, 1.5, 4.0],
        yaw_rad: 0.3,
        horizon_rad: 0.5,
    };
    let sites = SiteNoise {
        cell_m: 0.25,
        stride_px: 6,
        persistence: 0.5,
        lasting: Stream::new(1, &["lasting"]),
        passing: Stream::new(1, &["passing"]),
    };
    c.bench_function("noise/sites_300x300", |b| {
        b.iter(|| surface_sites(black_box(&depth_m), &camera, &sites));
    });
}

criterion_group!(benches, bench_noise);
criterion_main!(benches);
