//! Sight lines past remembered points, against a plain twin and by hand.

use evonav_core::{
    geometry::Vec3,
    memory::objects::{
        DetectedView, ObjectMap, ObjectMapConfig,
        sight_lines::{SightConfig, visible_shares},
    },
    sensors::{
        camera::Camera,
        runs::RunImage,
        unproject::{MaskedDepth, Point},
    },
};
use proptest::{collection::vec, prelude::*};

/// Every sample of every line against every point.
fn visible_shares_naive(
    scene: &[Vec<Point>],
    targets: &[Point],
    eyes: &[Vec3],
    config: &SightConfig,
) -> Vec<f64> {
    let stride = targets.len().div_ceil(config.max_targets).max(1);
    let targets: Vec<Point> = targets.iter().copied().step_by(stride).collect();
    let sees = |eye: Vec3, target: Point| {
        let offset = [0, 1, 2].map(|i| f64::from(target[i]) - eye[i]);
        let length_m = offset.iter().map(|v| v * v).sum::<f64>().sqrt();
        let sampled_m = length_m - 2.0 * config.margin_m;
        let step_m = config.step_m.max(sampled_m / config.max_samples as f64);
        let mut k = 0;
        while length_m > 0.0 && f64::from(k) <= sampled_m / step_m {
            let along_m = config.margin_m + step_m * f64::from(k);
            let sample = [0, 1, 2].map(|i| eye[i] + offset[i] / length_m * along_m);
            let is_near = |point: &Point| {
                let gaps = [0, 1, 2].map(|i| f64::from(point[i]) - sample[i]);
                gaps.iter().map(|v| v * v).sum::<f64>() < config.radius_m * config.radius_m
            };
            if scene.iter().flatten().any(is_near) {
                return false;
            }
            k += 1;
        }
        true
    };
    let share = |&eye: &Vec3| {
        let num_seen = targets.iter().filter(|&&target| sees(eye, target)).count();
        num_seen as f64 / targets.len().max(1) as f64
    };
    eyes.iter().map(share).collect()
}

fn shares(
    scene: &[Vec<Point>],
    targets: &[Point],
    eyes: &[Vec3],
    config: &SightConfig,
) -> Vec<f64> {
    visible_shares(scene.iter().map(Vec::as_slice), targets, eyes, config).expect("valid arguments")
}

/// A square of points 2 cm apart, facing z.
fn plate(centre: [f32; 3], half_m: f32) -> Vec<Point> {
    let num = (half_m / 0.02) as i32;
    let at = |i: i32, j: i32| [centre[0] + 0.02 * i as f32, centre[1] + 0.02 * j as f32, centre[2]];
    (-num..=num).flat_map(|i| (-num..=num).map(move |j| at(i, j))).collect()
}

#[test]
fn an_occluder_hides_the_target_from_one_side_only() {
    let target = plate([0.0, 1.0, 0.0], 0.1);
    let screen = plate([0.0, 1.0, 0.4], 0.6);
    let eyes = [[0.0, 1.5, 0.75], [0.0, 1.5, -0.75]];
    let scene = [target.clone(), screen];
    assert_eq!(shares(&scene, &target, &eyes, &SightConfig::default()), [0.0, 1.0]);
}

#[test]
fn what_stands_within_the_margins_hides_nothing() {
    let target = vec![[0.0, 0.0, 1.01]];
    let eyes = [[0.0; 3]];
    let config = SightConfig::default();
    let seen = |z: f32| shares(&[vec![[0.0, 0.0, z]]], &target, &eyes, &config)[0];
    assert_eq!([0.05, 0.09, 0.5, 0.92, 1.01].map(seen), [1.0, 1.0, 0.0, 1.0, 1.0]);
    // Samples stand at 0.15, 0.20, ... 0.85 m.
    assert_eq!([0.11, 0.89].map(seen), [0.0, 0.0]);
}

#[test]
fn nothing_to_see_and_nothing_in_the_way() {
    let config = SightConfig::default();
    assert_eq!(shares(&[], &[], &[[0.0; 3]], &config), [0.0]);
    assert_eq!(shares(&[], &[[1.0, 0.0, 0.0]], &[[0.0; 3], [1.0, 0.0, 0.0]], &config), [1.0, 1.0]);
    assert!(shares(&[], &[[1.0; 3]], &[], &config).is_empty());
}

#[test]
fn a_long_line_has_no_more_samples_than_asked_for() {
    // Every tenth metre: the point between two samples is missed.
    let config = SightConfig { max_samples: 10, ..Default::default() };
    let seen =
        |x: f32| shares(&[vec![[x, 0.0, 0.0]]], &[[100.3, 0.0, 0.0]], &[[0.0; 3]], &config)[0];
    assert_eq!([5.0, 10.15, 15.0, 50.15].map(seen), [1.0, 0.0, 1.0, 0.0]);
}

#[test]
fn bad_arguments_are_named() {
    let say = |targets: &[Point], eyes: &[Vec3], config: &SightConfig| {
        visible_shares([], targets, eyes, config).expect_err("must be refused").to_string()
    };
    let config = SightConfig::default();
    assert!(say(&[[f32::NAN, 0.0, 0.0]], &[], &config).contains("targets"));
    assert!(say(&[], &[[0.0, f64::INFINITY, 0.0]], &config).contains("eyes"));
    for (name, config) in [
        ("radius_m", SightConfig { radius_m: 0.0, ..config }),
        ("step_m", SightConfig { step_m: f64::NAN, ..config }),
        ("margin_m", SightConfig { margin_m: -1.0, ..config }),
        ("max_samples", SightConfig { max_samples: 0, ..config }),
        ("max_targets", SightConfig { max_targets: 0, ..config }),
    ] {
        assert!(say(&[], &[], &config).contains(name), "{name}");
    }
    let wild = [[f32::NAN, 0.0, 0.5], [f32::INFINITY, 0.0, 0.5]];
    let seen = visible_shares([&wild[..]], &[[0.0, 0.0, 1.0]], &[[0.0; 3]], &config);
    assert_eq!(seen, Ok(vec![1.0]));
}

/// A wall of points 1.2 m wide, one metre ahead of an eye that looks along z.
fn see_wall(map: &mut ObjectMap, eye: Vec3) {
    let camera = Camera {
        width_px: 100,
        height_px: 100,
        vertical_fov_rad: 1.2,
        position_m: eye,
        yaw_rad: 0.0,
        horizon_rad: 0.0,
    };
    let masks = RunImage::of(&[0; 10_000], 100).expect("a square image");
    let image = MaskedDepth { camera, depth_m: &[1.0; 10_000], masks: &masks };
    let labels = ["Screen".to_owned()];
    let view = DetectedView { image, labels: &labels, confidences: &[1.0], features: &[] };
    map.update(&view).expect("a valid view");
}

#[test]
fn a_map_leaves_out_only_entries_that_are_in_nobodys_way() {
    let mut map = ObjectMap::new(ObjectMapConfig::default()).expect("a valid configuration");
    for x in [0.0, 5.0, 1.3, -40.0] {
        see_wall(&mut map, [x, 1.0, 0.0]);
    }
    assert_eq!(map.entries().len(), 4);
    let target = plate([0.2, 1.0, 1.5], 0.3);
    let eyes: Vec<Vec3> = (0..20)
        .map(|i| f64::from(i) * std::f64::consts::TAU / 20.0)
        .map(|angle| [0.2 + 0.75 * angle.sin(), 1.3, 1.5 + 0.75 * angle.cos()])
        .collect();
    let config = SightConfig::default();
    let mut scene: Vec<Vec<Point>> =
        map.entries().iter().map(|entry| entry.cloud.points().to_vec()).collect();
    scene.push(target.clone());
    let found = map.visible_shares(&target, &eyes, &config).expect("valid places");
    assert_eq!(found, shares(&scene, &target, &eyes, &config));
    assert!(found[0] > 0.9 && found[10] == 0.0, "{found:?}");
}

fn points(num: usize, reach: f32) -> impl Strategy<Value = Vec<Point>> {
    vec([-reach..reach, -reach..reach, -reach..reach], 0..num)
}

proptest! {
    #[test]
    fn agrees_with_the_twin(
        scene in vec(points(200, 1.0), 0..4),
        targets in points(30, 1.0),
        eyes in vec([-2.0..2.0, -2.0..2.0, -2.0..2.0], 0..5),
        radius_m in 0.02..0.3_f64,
        step_m in 0.01..0.3_f64,
        margin_m in 0.0..0.4_f64,
        max_targets in 1..40_usize,
        max_samples in 1..100_usize,
    ) {
        let config = SightConfig { radius_m, step_m, margin_m, max_samples, max_targets };
        prop_assert_eq!(
            shares(&scene, &targets, &eyes, &config),
            visible_shares_naive(&scene, &targets, &eyes, &config)
        );
    }

    #[test]
    fn spread_out_points_agree_too(
        scene in vec(points(20, 60.0), 0..3),
        targets in points(10, 60.0),
        eyes in vec([-60.0..60.0, -60.0..60.0, -60.0..60.0], 1..4),
    ) {
        let config = SightConfig { radius_m: 2.0, ..Default::default() };
        prop_assert_eq!(
            shares(&scene, &targets, &eyes, &config),
            visible_shares_naive(&scene, &targets, &eyes, &config)
        );
    }
}
