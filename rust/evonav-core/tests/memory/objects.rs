//! The object memory as a whole against a plain quadratic twin.

use std::collections::BTreeMap;

use evonav_core::{
    memory::objects::{DetectedView, ObjectMap, ObjectMapConfig, Update},
    sensors::{
        camera::Camera,
        runs::RunImage,
        unproject::{MaskedDepth, Point, unproject_masks},
    },
};
use proptest::{collection::vec, prelude::*};

use super::points::{
    dbscan_naive, distance2, first_of_voxels, overlap_naive, unproject_naive, voxel_filter_naive,
};

/// Boxes `(centre, size, label)` seen by a camera: depth and masks, box by box and pixel by pixel.
type SolidBox = ([f64; 3], [f64; 3], &'static str);

const SIDE_PX: usize = 48;

fn look(boxes: &[SolidBox], camera: &Camera) -> (Vec<f32>, RunImage) {
    let cast = |i: usize| {
        let ray = camera.ray([(i % SIDE_PX) as f64 + 0.5, (i / SIDE_PX) as f64 + 0.5]);
        let hit = |(centre, size, _): &SolidBox| {
            let (mut enter, mut leave) = (0.0_f64, f64::INFINITY);
            for axis in 0..3 {
                let middle = centre[axis] - camera.position_m[axis];
                let (a, b) = (
                    (middle - size[axis] / 2.0) / ray[axis],
                    (middle + size[axis] / 2.0) / ray[axis],
                );
                (enter, leave) = (enter.max(a.min(b)), leave.min(a.max(b)));
            }
            (enter < leave && enter > 0.0).then_some(enter)
        };
        let hits = boxes.iter().enumerate().filter_map(|(k, b)| Some((hit(b)?, k)));
        let nearest = hits.min_by(|a, b| a.0.total_cmp(&b.0));
        nearest.map_or((f32::INFINITY, -1), |(depth, k)| (depth as f32, k as i32))
    };
    let (depth_m, masks): (_, Vec<i32>) = (0..SIDE_PX * SIDE_PX).map(cast).unzip();
    (depth_m, RunImage::of(&masks, SIDE_PX).unwrap())
}

fn camera(x: f64, z: f64, yaw_rad: f64) -> Camera {
    Camera {
        width_px: SIDE_PX,
        height_px: SIDE_PX,
        vertical_fov_rad: 1.5,
        position_m: [x, 1.5, z],
        yaw_rad,
        horizon_rad: 0.4,
    }
}

/// The same pipeline with nothing clever in it; entries are `(id, label counts, points)`.
struct NaiveMap {
    config: ObjectMapConfig,
    entries: Vec<(u64, BTreeMap<String, u32>, Vec<Point>)>,
    next_id: u64,
}

impl NaiveMap {
    fn clean(&self, points: &[Point]) -> Option<Vec<Point>> {
        if points.len() < self.config.min_points {
            return None;
        }
        let points = voxel_filter_naive(points, self.config.voxel_m);
        let labels = dbscan_naive(
            &points,
            self.config.cluster_radius_m as f32,
            self.config.cluster_min_points,
        );
        let size = |k: i32| labels.iter().filter(|&&label| label == k).count();
        let num = labels.iter().max().map_or(0, |k| k + 1);
        let best = (0..num).rev().max_by_key(|&k| size(k));
        let cluster: Vec<Point> = points
            .iter()
            .zip(&labels)
            .filter(|(_, k)| Some(**k) == best)
            .map(|(p, _)| *p)
            .collect();
        Some(if cluster.len() >= 5 { cluster } else { points })
    }

    fn update(&mut self, view: &DetectedView<'_>) -> Vec<Option<u64>> {
        let radius = self.config.overlap_radius_m as f32;
        let camera_m = view.image.camera.position_m;
        let before = self.entries.clone();
        let clouds = unproject_naive(view.image, view.labels.len(), self.config.max_points);
        let mut ids = Vec::new();
        for (label, cloud) in view.labels.iter().zip(clouds) {
            let Some(cloud) = self.clean(&cloud) else {
                ids.push(None);
                continue;
            };
            let middle = |axis: usize| {
                let values = || cloud.iter().map(|p| f64::from(p[axis]));
                (values().fold(f64::INFINITY, f64::min)
                    + values().fold(f64::NEG_INFINITY, f64::max))
                    / 2.0
            };
            if (middle(0) - camera_m[0]).hypot(middle(2) - camera_m[2]) > self.config.max_distance_m
            {
                ids.push(None);
                continue;
            }
            let score = |(_, counts, points): &(u64, BTreeMap<String, u32>, Vec<Point>)| {
                let most = counts.values().max();
                // Scenes here never give an entry two labels of equal count.
                let same = counts.get(label) == most;
                overlap_naive(&cloud, points, radius)
                    + self.config.visual_weight * f64::from(u8::from(same))
            };
            let mut best = (self.config.match_threshold, None);
            for (i, entry) in before.iter().enumerate() {
                if score(entry) > best.0 {
                    best = (score(entry), Some(i));
                }
            }
            let index = best.1.unwrap_or_else(|| {
                self.entries.push((self.next_id, BTreeMap::new(), Vec::new()));
                self.next_id += 1;
                self.entries.len() - 1
            });
            let (id, counts, points) = &mut self.entries[index];
            *counts.entry(label.clone()).or_default() += 1;
            points.extend(cloud);
            *points = first_of_voxels(points, self.config.voxel_m);
            ids.push(Some(*id));
        }
        ids
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 40, failure_persistence: None, ..Default::default() })]

    #[test]
    fn views_of_random_rooms_give_the_entries_of_the_plain_pipeline(
        boxes in vec(([-1.5..1.5, 0.2..1.2, 1.0..3.5], [0.05..0.6, 0.05..0.6, 0.05..0.6], 0..3_usize), 1..7),
        cameras in vec((-0.6..0.6, -0.6..0.4, -0.5..0.5), 1..5),
        voxel_m in 0.008..0.03,
        (visual_weight, match_threshold) in prop_oneof![Just((1.0, 1.2)), Just((0.0, 0.01))],
    ) {
        let boxes: Vec<SolidBox> =
            boxes.into_iter().map(|(c, s, k)| (c, s, ["Chair", "Mug", "Bed"][k])).collect();
        let labels: Vec<String> = boxes.iter().map(|b| b.2.to_owned()).collect();
        let config = ObjectMapConfig {
            voxel_m, visual_weight, match_threshold, views_per_cleanup: 0, ..Default::default()
        };
        let mut map = ObjectMap::new(config).unwrap();
        let mut naive = NaiveMap { config, entries: Vec::new(), next_id: 1 };
        for (x, z, yaw_rad) in cameras {
            let camera = camera(x, z, yaw_rad);
            let (depth_m, masks) = look(&boxes, &camera);
            let image = MaskedDepth { camera, depth_m: &depth_m, masks: &masks };
            let view = DetectedView {
                image, labels: &labels, confidences: &vec![1.0; labels.len()], features: &[],
            };
            prop_assert_eq!(map.update(&view).unwrap().entry_ids, naive.update(&view));
            for (entry, (id, _, points)) in map.entries().iter().zip(&naive.entries) {
                prop_assert_eq!(entry.id, *id);
                prop_assert_eq!(entry.cloud.points(), points);
            }
        }
    }

    #[test]
    fn pixels_unproject_to_where_the_camera_says(
        max_points in 1_usize..3000, x in -1.0..1.0, yaw_rad in -9.0..9.0,
    ) {
        let boxes = [([x, 1.0, 2.0], [1.0; 3], "Bed"), ([-0.5, 0.5, 1.2], [0.3; 3], "Mug")];
        let camera = camera(x, 0.0, yaw_rad);
        let (depth_m, masks) = look(&boxes, &camera);
        let image = MaskedDepth { camera, depth_m: &depth_m, masks: &masks };
        let clouds = unproject_masks(image, 2, max_points).unwrap();
        let naive = unproject_naive(image, 2, max_points);
        prop_assert_eq!(clouds.iter().map(Vec::len).collect::<Vec<_>>(), naive.iter().map(Vec::len).collect::<Vec<_>>());
        for (a, b) in clouds.iter().flatten().zip(naive.iter().flatten()) {
            prop_assert!(distance2(*a, *b) < 1e-10, "{a:?} {b:?}");
        }
    }
}

fn see(map: &mut ObjectMap, boxes: &[SolidBox], camera: &Camera) -> Update {
    let labels: Vec<String> = boxes.iter().map(|b| b.2.to_owned()).collect();
    let (depth_m, masks) = look(boxes, camera);
    let image = MaskedDepth { camera: *camera, depth_m: &depth_m, masks: &masks };
    let confidences = vec![1.0; labels.len()];
    map.update(&DetectedView { image, labels: &labels, confidences: &confidences, features: &[] })
        .expect("a valid view")
}

const SOFA: SolidBox = ([0.0, 0.5, 2.0], [1.0, 0.6, 0.5], "Sofa");

#[test]
fn a_moved_object_becomes_a_new_entry_and_the_old_one_goes_stale_until_removed() {
    let mut map = ObjectMap::new(ObjectMapConfig::default()).unwrap();
    let camera = camera(0.0, 0.0, 0.0);
    assert_eq!(see(&mut map, &[SOFA], &camera).entry_ids, [Some(1)]);
    assert_eq!(see(&mut map, &[SOFA], &camera).entry_ids, [Some(1)]);
    map.begin_stage(2);
    let moved = ([-1.2, 0.5, 2.5], SOFA.1, SOFA.2);
    assert_eq!(see(&mut map, &[moved], &camera).entry_ids, [Some(2)]);
    let old = map.entry(1).unwrap();
    assert_eq!((old.num_detections, old.first_seen_stage, old.last_seen_stage), (2, 1, 1));
    assert!((old.centre_m()[0] - 0.0).abs() < 0.05 && old.label() == "Sofa");
    assert!(map.remove(1) && !map.remove(1) && map.entry(1).is_none());
    assert_eq!(see(&mut map, &[SOFA], &camera).entry_ids, [Some(3)]);
    map.clear();
    assert_eq!(see(&mut map, &[SOFA], &camera).entry_ids, [Some(1)]);
}

#[test]
fn compare_tells_an_object_still_there_from_one_gone() {
    let mut map = ObjectMap::new(ObjectMapConfig::default()).unwrap();
    let camera = camera(0.0, 0.0, 0.0);
    see(&mut map, &[SOFA], &camera);
    let compare = |boxes: &[SolidBox]| {
        let labels: Vec<String> = boxes.iter().map(|b| b.2.to_owned()).collect();
        let (depth_m, masks) = look(boxes, &camera);
        let image = MaskedDepth { camera, depth_m: &depth_m, masks: &masks };
        let confidences = vec![1.0; labels.len()];
        let view =
            DetectedView { image, labels: &labels, confidences: &confidences, features: &[] };
        map.compare(1, &view).unwrap()[0]
    };
    let here = compare(&[SOFA]);
    assert!(here.overlap > 0.99 && here.distance_m < 0.5, "{here:?}");
    let gone = compare(&[([-1.2, 0.5, 2.9], SOFA.1, SOFA.2)]);
    assert!(gone.overlap < 0.01 && gone.distance_m > 0.9, "{gone:?}");
}

#[test]
fn a_clean_up_merges_the_pieces_of_an_object_and_drops_far_single_sightings() {
    let config = ObjectMapConfig { views_per_cleanup: 5, ..Default::default() };
    let mut map = ObjectMap::new(config).unwrap();
    // Two ends of a bed are seen first, too far apart to be taken for one, and a dresser once.
    let end = |x: f64| ([x, 0.5, 2.0], [0.3, 0.3, 0.3], "Bed");
    let first = see(
        &mut map,
        &[end(-0.4), end(0.4), ([0.9, 1.0, 3.0], [0.8; 3], "Dresser")],
        &camera(0.0, 0.0, 0.0),
    );
    assert_eq!(first.entry_ids, [Some(1), Some(2), Some(3)]);
    let whole = ([0.0, 0.5, 2.0], [1.1, 0.3, 0.3], "Bed");
    for _ in 0..3 {
        see(&mut map, &[whole], &camera(0.0, 0.0, 0.0));
    }
    let last = see(&mut map, &[whole], &camera(0.0, -0.9, 0.0));
    assert_eq!(last.removed, [3], "{last:?}");
    assert_eq!(map.entries().len(), 1);
    assert_eq!(last.merged.len(), 1);
    assert_eq!(last.entry_ids, [Some(map.entries()[0].id)]);
    assert_eq!(map.entries()[0].num_detections, 6);
}

#[test]
fn features_decide_where_there_are_any() {
    let mut map = ObjectMap::new(ObjectMapConfig::default()).unwrap();
    let camera = camera(0.0, 0.0, 0.0);
    let (depth_m, masks) = look(&[SOFA], &camera);
    let image = MaskedDepth { camera, depth_m: &depth_m, masks: &masks };
    let mut see = |label: &str, feature: [f32; 2]| {
        let view = DetectedView {
            image,
            labels: &[label.to_owned()],
            confidences: &[0.5],
            features: &feature,
        };
        map.update(&view).unwrap().entry_ids[0]
    };
    assert_eq!(see("Sofa", [1.0, 0.0]), Some(1));
    assert_eq!(see("ArmChair", [0.8, 0.6]), Some(1)); // overlap 1 + cosine 0.8
    assert_eq!(see("Sofa", [-0.6, 0.8]), Some(2)); // the same place, another look
    let feature = map.entry(1).unwrap().feature.clone().unwrap();
    assert!((feature[0].hypot(feature[1]) - 1.0).abs() < 1e-6 && feature[1] > 0.3);
}

#[test]
fn arguments_that_do_not_fit_are_named_and_change_nothing() {
    let mut map = ObjectMap::new(ObjectMapConfig::default()).unwrap();
    let camera = camera(0.0, 0.0, 0.0);
    let (depth_m, masks) = look(&[SOFA], &camera);
    let labels = ["Sofa".to_owned()];
    let good = DetectedView {
        image: MaskedDepth { camera, depth_m: &depth_m, masks: &masks },
        labels: &labels,
        confidences: &[1.0],
        features: &[],
    };
    let mut fails = |view: &DetectedView<'_>, name: &str| {
        let message = map.update(view).unwrap_err().to_string();
        assert!(message.contains(&format!("`{name}`")), "{message}");
        assert_eq!(map.num_views(), 0);
    };
    let nan = vec![f32::NAN; depth_m.len()];
    let with =
        |depth_m, masks| DetectedView { image: MaskedDepth { camera, depth_m, masks }, ..good };
    fails(&with(&nan, &masks), "depth_m");
    fails(&with(&depth_m[1..], &masks), "depth_m");
    let row = RunImage::of(&masks.pixels(), depth_m.len()).unwrap();
    fails(&with(&depth_m, &row), "masks");
    let ones = RunImage::of(&vec![1; depth_m.len()], SIDE_PX).unwrap();
    fails(&with(&depth_m, &ones), "masks");
    fails(&DetectedView { confidences: &[], ..good }, "confidences");
    fails(&DetectedView { confidences: &[f32::NAN], ..good }, "confidences");
    fails(&DetectedView { features: &[f32::INFINITY], ..good }, "features");
    let view_of = |name: &str, config| {
        let message = ObjectMap::new(config).unwrap_err().to_string();
        assert!(message.contains(name), "{message}");
    };
    view_of("voxel_m", ObjectMapConfig { voxel_m: 0.0, ..Default::default() });
    view_of("visual_weight", ObjectMapConfig { visual_weight: -1.0, ..Default::default() });
    view_of("match_threshold", ObjectMapConfig { match_threshold: f64::NAN, ..Default::default() });
}
