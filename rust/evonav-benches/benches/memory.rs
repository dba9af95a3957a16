//! The memory at the size of one observation: 300 x 300 pixels, 20 detections, 100 entries, a 400 x 400 map.

use std::{f64::consts::FRAC_PI_2, hint::black_box};

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use evonav_core::{
    grid::GridSpec,
    memory::{
        frontiers::{FrontierConfig, Frontiers},
        objects::{
            DetectedView, ObjectMap, ObjectMapConfig, depth_evidence::EvidenceConfig,
            seen_through::SeeThroughConfig, sight_lines::SightConfig,
        },
        occupancy::OccupancyMap,
    },
    sensors::{
        camera::Camera, runs::RunImage, unproject::MaskedDepth, visible_cells::visible_cells,
    },
};

const SIDE_PX: usize = 300;
const BOX_M: f64 = 0.4;

/// A hundred boxes on a floor, ten a row.
fn boxes() -> Vec<[f64; 3]> {
    (0..100)
        .map(|i| [(i % 10) as f64 * 0.8, 0.2 + 0.05 * f64::from(i % 7), (i / 10) as f64 * 0.8])
        .collect()
}

fn camera(x: f64, y: f64, z: f64, yaw_rad: f64, horizon_rad: f64) -> Camera {
    Camera {
        width_px: SIDE_PX,
        height_px: SIDE_PX,
        vertical_fov_rad: FRAC_PI_2,
        position_m: [x, y, z],
        yaw_rad,
        horizon_rad,
    }
}

/// Depth and masks of some of the boxes; masks count in their order.
fn look(boxes: &[[f64; 3]], camera: &Camera) -> (Vec<f32>, Vec<i32>) {
    // A ray is affine in the coordinates of its pixel.
    let first = camera.ray([0.5, 0.5]);
    let (right, below) = (camera.ray([1.5, 0.5]), camera.ray([0.5, 1.5]));
    let cast = |i: usize| {
        let (col, row) = ((i % SIDE_PX) as f64, (i / SIDE_PX) as f64);
        let ray =
            [0, 1, 2].map(|a| first[a] + (right[a] - first[a]) * col + (below[a] - first[a]) * row);
        let hit = |centre: &[f64; 3]| {
            let (mut enter, mut leave) = (0.0_f64, f64::INFINITY);
            for axis in 0..3 {
                let middle = centre[axis] - camera.position_m[axis];
                let (a, b) =
                    ((middle - BOX_M / 2.0) / ray[axis], (middle + BOX_M / 2.0) / ray[axis]);
                (enter, leave) = (enter.max(a.min(b)), leave.min(a.max(b)));
            }
            (enter < leave && enter > 0.0).then_some(enter)
        };
        let hits = boxes.iter().enumerate().filter_map(|(k, b)| Some((hit(b)?, k)));
        let nearest = hits.min_by(|a, b| a.0.total_cmp(&b.0));
        nearest.map_or((f32::INFINITY, -1), |(depth, k)| (depth as f32, k as i32))
    };
    (0..SIDE_PX * SIDE_PX).map(cast).unzip()
}

fn runs(masks: &[i32]) -> RunImage {
    RunImage::of(masks, SIDE_PX).expect("whole rows")
}

/// Each box seen from four sides and above.
fn full_map(config: ObjectMapConfig) -> ObjectMap {
    let mut map = ObjectMap::new(config).expect("a valid configuration");
    for &[x, y, z] in &boxes() {
        let quarter = FRAC_PI_2;
        for (dx, dz, turn) in [(0.0, -0.9, 0.0), (-0.9, 0.0, 1.0), (0.0, 0.9, 2.0), (0.9, 0.0, 3.0)]
        {
            let camera = camera(x + dx, y + 0.7, z + dz, turn * quarter, 0.7);
            let (depth_m, masks) = look(&[[x, y, z]], &camera);
            let masks = runs(&masks);
            let image = MaskedDepth { camera, depth_m: &depth_m, masks: &masks };
            let labels = ["Box".to_owned()];
            let view = DetectedView { image, labels: &labels, confidences: &[1.0], features: &[] };
            map.update(&view).expect("a valid view");
        }
    }
    map
}

fn bench_objects(c: &mut Criterion) {
    let config = ObjectMapConfig { views_per_cleanup: 0, ..Default::default() };
    let map = full_map(config);
    // The twenty boxes that show most of themselves.
    let camera = camera(3.4, 1.9, 1.2, 0.2, 0.6);
    let (depth_m, masks) = look(&boxes(), &camera);
    let mut areas: Vec<(usize, i32)> =
        (0..100).map(|k| (masks.iter().filter(|&&m| m == k).count(), k)).collect();
    areas.sort_by(|a, b| b.cmp(a));
    areas.truncate(20);
    let number = |mask: &i32| areas.iter().position(|a| a.1 == *mask).map_or(-1, |i| i as i32);
    let masks = runs(&masks.iter().map(number).collect::<Vec<_>>());
    let labels = vec!["Box".to_owned(); 20];
    let confidences = [1.0; 20];
    let image = MaskedDepth { camera, depth_m: &depth_m, masks: &masks };
    let view = DetectedView { image, labels: &labels, confidences: &confidences, features: &[] };
    c.bench_function("objects/update_20_masks_100_entries", |b| {
        b.iter_batched_ref(
            || map.clone(),
            |map| map.update(black_box(&view)).expect("a valid view"),
            BatchSize::LargeInput,
        );
    });
    // Twenty eyes around one of the middle boxes, whose neighbours stand in between.
    let target = map.entries()[44].cloud.points();
    let [x, _, z] = boxes()[44];
    let eyes: Vec<[f64; 3]> = (0..20)
        .map(|i| f64::from(i) * FRAC_PI_2 / 5.0)
        .map(|angle| [x + 0.75 * angle.sin(), 1.5, z + 0.75 * angle.cos()])
        .collect();
    let num_points: usize = map.entries().iter().map(|entry| entry.cloud.points().len()).sum();
    assert!(num_points > 200_000, "{num_points} points");
    let sight = SightConfig::default();
    c.bench_function("objects/visible_shares_20_eyes_100_entries", |b| {
        b.iter(|| map.visible_shares(black_box(target), &eyes, &sight).expect("valid places"));
    });
    let ids: Vec<u64> = map.entries().iter().map(|entry| entry.id).collect();
    let evidence = EvidenceConfig::default();
    c.bench_function("objects/depth_evidence_100_entries", |b| {
        b.iter(|| {
            map.depth_evidence(black_box(&ids), &camera, &depth_m, &evidence).expect("known ids")
        });
    });
    bench_forgetting(c, &map, &camera, &depth_m);
    // As many views as fill the map: the next one is due for a clean-up.
    let due = full_map(ObjectMapConfig { views_per_cleanup: 401, ..config });
    let nothing = runs(&[-1; SIDE_PX * SIDE_PX]);
    let image = MaskedDepth { masks: &nothing, ..image };
    let view = DetectedView { image, labels: &[], confidences: &[], features: &[] };
    c.bench_function("objects/clean_up_100_entries", |b| {
        b.iter_batched_ref(
            || due.clone(),
            |map| map.update(black_box(&view)).expect("a valid view"),
            BatchSize::LargeInput,
        );
    });
}

/// What forgetting rules ask of a map in each frame.
fn bench_forgetting(c: &mut Criterion, map: &ObjectMap, camera: &Camera, depth_m: &[f32]) {
    c.bench_function("objects/in_view_100_entries", |b| {
        b.iter(|| map.in_view(black_box(camera), 3.5).expect("a valid camera"));
    });
    let config = SeeThroughConfig::default();
    c.bench_function("objects/remove_seen_through_nothing_gone_100_entries", |b| {
        b.iter_batched_ref(
            || map.clone(),
            |map| map.remove_seen_through(camera, black_box(depth_m), &config).expect("a view"),
            BatchSize::LargeInput,
        );
    });
    let nothing_there = vec![9.0; depth_m.len()];
    c.bench_function("objects/remove_seen_through_all_gone_100_entries", |b| {
        b.iter_batched_ref(
            || map.clone(),
            |map| {
                map.remove_seen_through(camera, black_box(&nothing_there), &config).expect("a view")
            },
            BatchSize::LargeInput,
        );
    });
    c.bench_function("objects/num_bytes_100_entries", |b| b.iter(|| black_box(map).num_bytes()));
}

/// Rooms of 40 x 40 cells with a door in every wall and something in the way.
fn floor(spec: &GridSpec) -> Vec<u8> {
    let is_blocked = |row: usize, col: usize| {
        let (r, c) = (row % 40, col % 40);
        let is_door = (15..23).contains(&r) || (15..23).contains(&c);
        ((r < 2 || c < 2) && !is_door) || ((25..33).contains(&r) && (8..13).contains(&c))
    };
    (0..spec.len()).map(|i| u8::from(is_blocked(i / spec.cols, i % spec.cols))).collect()
}

fn bench_occupancy(c: &mut Criterion) {
    let spec = GridSpec { rows: 400, cols: 400, cell_m: 0.1, corner_m: [0.0, 0.0] };
    let blocked = floor(&spec);
    let look = |origin_m: [f64; 2], yaw_rad: f64| {
        visible_cells(&blocked, &spec, origin_m, yaw_rad, FRAC_PI_2, 3.0).expect("a valid view")
    };
    c.bench_function("occupancy/visible_cells", |b| {
        b.iter(|| look(black_box([17.9, 18.1]), black_box(0.7)));
    });
    let seen = look([17.9, 18.1], 0.7);
    let mut map = OccupancyMap::new(spec).expect("a valid grid");
    c.bench_function("occupancy/integrate", |b| {
        b.iter(|| map.integrate(black_box(&seen), [17.9, 18.1], 1.7).expect("cells of the map"));
    });
    // A walk through half of the house leaves frontiers at its doors.
    for step in 0..60 {
        let origin_m = [5.9 + 0.45 * f64::from(step % 40), 5.9 + 4.0 * f64::from(step / 20)];
        for quarter in 0..4 {
            let seen = look(origin_m, f64::from(quarter) * FRAC_PI_2);
            map.integrate(&seen, origin_m, 1.7).expect("cells of the map");
        }
    }
    let config = FrontierConfig::default();
    let extract = |map: &OccupancyMap| {
        let mut frontiers = Frontiers::default();
        frontiers.update(map, [14.0, 9.9], &config).map(<[_]>::to_vec).expect("a valid place")
    };
    let found = extract(&map);
    assert!(found.len() > 5, "{} frontiers", found.len());
    c.bench_function("occupancy/frontiers_400x400", |b| {
        b.iter(|| extract(black_box(&map)));
    });
    let targets_m: Vec<_> = found.iter().map(|frontier| frontier.position_m).collect();
    c.bench_function("occupancy/distances_to_frontiers_400x400", |b| {
        b.iter(|| map.distances_m(black_box([14.0, 9.9]), &targets_m).expect("finite places"));
    });
}

criterion_group!(benches, bench_objects, bench_occupancy);
criterion_main!(benches);
