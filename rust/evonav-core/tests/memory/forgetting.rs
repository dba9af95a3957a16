//! What an object map needs to forget: entries in view, points that are seen through, its size.

use std::{collections::BTreeSet, mem::size_of};

use evonav_core::{
    memory::objects::{
        DetectedView, ObjectMap, ObjectMapConfig,
        seen_through::{Erosion, SeeThroughConfig},
    },
    sensors::{
        camera::Camera,
        runs::RunImage,
        unproject::{MaskedDepth, Point},
    },
};
use proptest::{collection::vec, prelude::*};

const CAMERA: Camera = Camera {
    width_px: 40,
    height_px: 30,
    vertical_fov_rad: std::f64::consts::FRAC_PI_2,
    position_m: [0.0, 1.5, 0.0],
    yaw_rad: 0.0,
    horizon_rad: 0.0,
};
const NUM_PX: usize = CAMERA.width_px * CAMERA.height_px;

/// Each point alone, by the camera's own projection; every pixel of the image is asked whether it is
/// near enough to count.
fn is_seen_through_naive(
    point: Point,
    camera: &Camera,
    depth_m: &[f32],
    config: &SeeThroughConfig,
) -> bool {
    let Some([u, v, z]) = camera.project(point.map(f64::from)) else { return false };
    let (col, row) = (u.floor() as i64, v.floor() as i64);
    let is_at = |index: usize, margin: i64| {
        let (r, c) = ((index / camera.width_px) as i64, (index % camera.width_px) as i64);
        (r - row).abs() <= margin && (c - col).abs() <= margin
    };
    let around = |margin: i64| (0..depth_m.len()).filter(move |&index| is_at(index, margin));
    let has_depth = |index: usize| depth_m[index] > 0.0 && depth_m[index].is_finite();
    let band_m = f64::max(config.band_m, config.band_share * z);
    z >= config.near_m
        && z <= config.far_m
        && around(0).any(has_depth)
        && around(config.margin_px as i64)
            .filter(|&index| has_depth(index))
            .all(|index| f64::from(depth_m[index]) > z + band_m)
}

/// A map of what some cameras saw, each pixel column strip an object of its own.
fn map_of(looks: &[(f64, f64, f32)]) -> ObjectMap {
    let mut map =
        ObjectMap::new(ObjectMapConfig { views_per_cleanup: 0, ..Default::default() }).unwrap();
    for &(x_m, yaw_rad, distance_m) in looks {
        let camera = Camera { position_m: [x_m, 1.5, 0.0], yaw_rad, ..CAMERA };
        let depth_m: Vec<f32> = (0..NUM_PX).map(|i| distance_m + 0.01 * (i % 40) as f32).collect();
        let masks: Vec<i32> = (0..NUM_PX).map(|i| (i % 40 / 10) as i32).collect();
        let labels: Vec<String> = (0..4).map(|i| format!("Strip{i}")).collect();
        let masks = RunImage::of(&masks, 40).unwrap();
        let image = MaskedDepth { camera, depth_m: &depth_m, masks: &masks };
        let view = DetectedView { image, labels: &labels, confidences: &[1.0; 4], features: &[] };
        map.update(&view).unwrap();
    }
    map
}

fn looks() -> impl Strategy<Value = Vec<(f64, f64, f32)>> {
    vec((-2.0..2.0, -3.2..3.2, 0.5_f32..2.5), 1..4)
}

fn depths() -> impl Strategy<Value = Vec<f32>> {
    // Patches, so that margins have something to see.
    let depth = prop_oneof![6 => 0.3_f32..6.0, 1 => Just(f32::INFINITY), 1 => Just(0.0_f32)];
    vec(depth, 48)
        .prop_map(|patches| (0..NUM_PX).map(|i| patches[(i / 40 / 5) * 8 + i % 40 / 5]).collect())
}

proptest! {
    #[test]
    fn the_points_that_are_left_are_those_of_the_plain_twin(
        seen in looks(),
        depth_m in depths(),
        yaw_rad in -3.2..3.2,
        horizon_rad in -0.6..0.6,
        band_m in 0.0..0.3,
        band_share in 0.0..0.1,
        far_m in 0.5..6.0,
        margin_px in 0_usize..3,
    ) {
        let before = map_of(&seen);
        let camera = Camera { yaw_rad, horizon_rad, ..CAMERA };
        let config = SeeThroughConfig { near_m: 0.01, far_m, band_m, band_share, margin_px };
        let mut map = before.clone();
        let eroded = map.remove_seen_through(&camera, &depth_m, &config).unwrap();
        let mut expected = Vec::new();
        for entry in before.entries() {
            let points = entry.cloud.points();
            let left: Vec<Point> = points
                .iter()
                .copied()
                .filter(|&point| !is_seen_through_naive(point, &camera, &depth_m, &config))
                .collect();
            if left.len() < points.len() {
                let num_removed = points.len() - left.len();
                expected.push(Erosion { id: entry.id, num_removed, num_left: left.len() });
            }
            match map.entry(entry.id) {
                Some(entry) => prop_assert_eq!(entry.cloud.points(), &left[..]),
                None => prop_assert!(left.is_empty()),
            }
        }
        prop_assert_eq!(eroded, expected);
        // Nothing is left to remove, and a place that is seen again can be filled again.
        prop_assert_eq!(map.remove_seen_through(&camera, &depth_m, &config).unwrap(), vec![]);
    }

    #[test]
    fn entries_in_view_are_those_of_the_plain_twin(
        seen in looks(),
        yaw_rad in -3.2..3.2,
        horizon_rad in -1.0..1.0,
        max_distance_m in 0.5..4.0,
    ) {
        let map = map_of(&seen);
        let camera = Camera { yaw_rad, horizon_rad, ..CAMERA };
        let found = map.in_view(&camera, max_distance_m).unwrap();
        for entry in map.entries() {
            let [x, _, z] = entry.centre_m();
            let is_near = x.hypot(z) <= max_distance_m;
            // No entry with a point in the image is left out.
            let shows = entry.cloud.points().iter().any(|&point| {
                camera.project(point.map(f64::from)).is_some_and(|[u, v, _]| {
                    (0.0..40.0).contains(&u) && (0.0..30.0).contains(&v)
                })
            });
            let is_found = found.contains(&entry.id);
            prop_assert!(is_found || !(is_near && shows));
            // An entry is left out exactly if all corners of its box are beyond the same border.
            let (centre, size) = (entry.centre_m(), entry.size_m());
            let beyond: Vec<[bool; 5]> = (0..8)
                .map(|k| {
                    let corner = [0, 1, 2].map(|i| {
                        centre[i] + size[i] * (f64::from(k >> i & 1) - 0.5) - camera.position_m[i]
                    });
                    let axes = camera.camera_from_world();
                    let [x, y, z] = [0, 1, 2].map(|i| (0..3).map(|j| axes[i][j] * corner[j]).sum::<f64>());
                    let (u, v) = (15.0 * x, 15.0 * y); // a focal length of 15 pixels, times z
                    [z < 0.0, u < -20.0 * z, u > 20.0 * z, v < -15.0 * z, v > 15.0 * z]
                })
                .collect();
            let is_outside = (0..5).any(|border| beyond.iter().all(|corner| corner[border]));
            prop_assert_eq!(is_found, is_near && !is_outside, "entry {}", entry.id);
        }
    }
}

#[test]
fn a_strip_that_is_gone_is_removed_as_a_whole_and_its_neighbours_stay() {
    let mut map = map_of(&[(0.0, 0.0, 2.0)]);
    let ids: Vec<u64> = map.entries().iter().map(|entry| entry.id).collect();
    let there: Vec<f32> = (0..NUM_PX).map(|i| 2.0 + 0.01 * (i % 40) as f32).collect();
    let config = SeeThroughConfig { margin_px: 0, ..Default::default() };
    assert_eq!(map.remove_seen_through(&CAMERA, &there, &config).unwrap(), vec![]);
    let gone: Vec<f32> =
        there.iter().enumerate().map(|(i, &d)| if i % 40 < 10 { 4.0 } else { d }).collect();
    let eroded = map.remove_seen_through(&CAMERA, &gone, &config).unwrap();
    assert_eq!(eroded.len(), 1);
    assert_eq!((eroded[0].id, eroded[0].num_left), (ids[0], 0));
    let left: Vec<u64> = map.entries().iter().map(|entry| entry.id).collect();
    assert_eq!(left, ids[1..]);
    assert!(map.entries().iter().all(|entry| entry.centre_m().iter().all(|v| v.is_finite())));
}

#[test]
fn what_does_not_fit_is_named() {
    let mut map = map_of(&[(0.0, 0.0, 2.0)]);
    let before = map.entries()[0].cloud.points().len();
    let config = SeeThroughConfig::default();
    let depth_m = vec![5.0; NUM_PX];
    for (name, wrong) in [
        ("near_m", SeeThroughConfig { near_m: f64::NAN, ..config }),
        ("far_m", SeeThroughConfig { far_m: -1.0, ..config }),
        ("band_m", SeeThroughConfig { band_m: -0.1, ..config }),
        ("band_share", SeeThroughConfig { band_share: 2.0, ..config }),
        ("margin_px", SeeThroughConfig { margin_px: 9, ..config }),
    ] {
        let error = map.remove_seen_through(&CAMERA, &depth_m, &wrong).unwrap_err();
        assert!(error.to_string().contains(name), "{error}");
    }
    let error = map.remove_seen_through(&CAMERA, &depth_m[1..], &config).unwrap_err();
    assert!(error.to_string().contains("depth_m"), "{error}");
    let error = map.in_view(&CAMERA, f64::NAN).unwrap_err();
    assert!(error.to_string().contains("max_distance_m"), "{error}");
    assert_eq!(map.entries()[0].cloud.points().len(), before);
}

#[test]
fn the_size_is_that_of_points_and_tables() {
    let empty = ObjectMap::new(ObjectMapConfig::default()).unwrap();
    assert_eq!(empty.num_bytes(), size_of::<ObjectMap>());
    let map = map_of(&[(0.0, 0.0, 2.0), (0.0, 2.0, 1.5)]);
    let num_blocks = |points: &[Point], edge_m: f32| {
        let blocks = points.iter().map(|point| point.map(|v| (v / edge_m).floor() as i32));
        blocks.collect::<BTreeSet<_>>().len()
    };
    // Three coordinates and a link a point; a bit a voxel, and a link and bits a block, in cubes of
    // 64 blocks.
    let estimate = |points: &[Point]| {
        points.len() * (size_of::<Point>() + size_of::<u32>())
            + num_blocks(points, 0.16) * 64 * (size_of::<u64>() + size_of::<u32>())
    };
    let least: usize = map.entries().iter().map(|entry| estimate(entry.cloud.points())).sum();
    // Vectors and hash tables have at most about as much room again, and blocks a key each.
    let most = 3 * least + map.entries().len() * 2000;
    assert!((least..most).contains(&map.num_bytes()), "{least} {} {most}", map.num_bytes());
    let mut fewer = map.clone();
    fewer.remove(map.entries()[0].id);
    assert!(fewer.num_bytes() < map.num_bytes());
}
