//! UniGoal's step at its size: 300 x 300 pixels into a map of 720 x 720 cells, a way of 10 m through rooms.

use std::{f64::consts::FRAC_PI_2, hint::black_box};

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use evonav_core::{
    grid::dilate::dilate_disk,
    sensors::camera::Camera,
    unigoal::{
        bev_config::BevConfig,
        bev_map::BevMap,
        depth_view::DepthView,
        exploration::{ExploreConfig, choose_frontier},
        path_planning::{PlanConfig, plan},
    },
};

const SIDE_PX: usize = 300;

/// Rooms of 4 x 4 m, with a doorway of 1.2 m in the middle of each wall; walls are 0.1 m thick.
fn is_wall(x: f64, z: f64) -> bool {
    let (a, b) = (x.rem_euclid(4.0), z.rem_euclid(4.0));
    (a < 0.1 && (b - 2.0).abs() > 0.6) || (b < 0.1 && (a - 2.0).abs() > 0.6)
}

fn look(x: f64, z: f64, yaw_rad: f64) -> (Camera, Vec<f32>) {
    let camera = Camera {
        width_px: SIDE_PX,
        height_px: SIDE_PX,
        vertical_fov_rad: FRAC_PI_2,
        position_m: [x, 1.575, z],
        yaw_rad,
        horizon_rad: 30.0_f64.to_radians(),
    };
    // How far the wall is that a pixel's heading meets, by steps of 2 cm; the floor may be nearer.
    let depth = |index: usize| {
        let pixel = [index % SIDE_PX, index / SIDE_PX].map(|k| k as f64 + 0.5);
        let [dx, dy, dz] = camera.ray(pixel);
        let flat = dx.hypot(dz).max(1e-9);
        let steps = (1..400).map(|i| f64::from(i) * 0.02 / flat);
        let wall = steps.map(|t| (t, x + t * dx, z + t * dz)).find(|(_, x, z)| is_wall(*x, *z));
        let to_wall = wall.map_or(f64::INFINITY, |w| w.0);
        let to_floor = if dy < -1e-6 { -1.575 / dy } else { f64::INFINITY };
        to_wall.min(to_floor) as f32
    };
    (camera, (0..SIDE_PX * SIDE_PX).map(depth).collect())
}

fn bench_unigoal(c: &mut Criterion) {
    let mut map = BevMap::new([2.0, 2.0], 16, BevConfig::default()).expect("a valid map");
    // Nine rooms, four looks in each.
    for room in 0..9_u32 {
        let (x, z) = (2.0 + 4.0 * f64::from(room % 3), 2.0 + 4.0 * f64::from(room / 3));
        for quarter in 0..4 {
            let (camera, depth_m) = look(x, z, f64::from(quarter) * FRAC_PI_2);
            let view = DepthView { camera, depth_m: &depth_m, categories: None };
            map.integrate(&view).expect("a valid view");
        }
    }
    let (camera, depth_m) = look(5.0, 6.0, 0.6);
    let categories: Vec<i32> =
        (0..SIDE_PX * SIDE_PX).map(|i| (i / 30 % 10) as i32 / 3 - 1).collect();
    let view = DepthView { camera, depth_m: &depth_m, categories: Some(&categories) };
    c.bench_function("bev/integrate_300x300", |b| {
        b.iter_batched_ref(
            || map.clone(),
            |map| map.integrate(black_box(&view)).expect("a valid view"),
            BatchSize::LargeInput,
        );
    });
    c.bench_function("bev/dilate_obstacles_720x720", |b| {
        b.iter(|| dilate_disk(black_box(map.obstacles()), 3));
    });
    let goal = map.spec().cell_of([10.0, 10.0]).expect("on the map").map(|i| i as i32);
    let way = plan(&map, [2.0, 2.0], &[goal], 10, &PlanConfig::default()).expect("on the map");
    assert!(way.distance_m.is_some_and(|d| d > 10.0), "{way:?}");
    c.bench_function("bev/plan_11_m", |b| {
        b.iter(|| plan(black_box(&map), [2.0, 2.0], &[goal], 10, &PlanConfig::default()));
    });
    let agent = map.spec().cell_of([6.0, 6.0]).expect("on the map");
    let end = map.spec().cell_of([2.0, 10.0]);
    assert!(choose_frontier(&map, agent, end, &ExploreConfig::default()).is_some());
    c.bench_function("bev/choose_frontier", |b| {
        b.iter(|| choose_frontier(black_box(&map), agent, end, &ExploreConfig::default()));
    });
}

criterion_group!(benches, bench_unigoal);
criterion_main!(benches);
