//! Depth evidence, against a plain twin and by hand.

use evonav_core::{
    memory::objects::{
        DetectedView, ObjectMap, ObjectMapConfig,
        depth_evidence::{DepthEvidence, EvidenceConfig, depth_evidence},
    },
    sensors::{
        camera::Camera,
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

/// Each point alone, by the camera's own projection.
fn depth_evidence_naive(
    cloud: &[Point],
    image: MaskedDepth<'_>,
    num_detections: usize,
    config: &EvidenceConfig,
) -> DepthEvidence {
    let MaskedDepth { camera, depth_m, masks } = image;
    let num = cloud.len().min(config.max_points);
    let mut found = counts(num_detections);
    for k in 0..num {
        let point = cloud[(k * cloud.len()).checked_div(num).unwrap()];
        let Some([u, v, z]) = camera.project(point.map(f64::from)) else {
            found.num_out_of_view += 1;
            continue;
        };
        let (col, row) = (u.floor(), v.floor());
        let is_outside = col < 0.0
            || row < 0.0
            || col >= camera.width_px as f64
            || row >= camera.height_px as f64;
        if is_outside {
            found.num_out_of_view += 1;
            continue;
        }
        let pixel = row as usize * camera.width_px + col as usize;
        let depth = f64::from(depth_m[pixel]);
        let band_m = f64::max(config.band_m, config.band_share * z);
        if depth <= 0.0 || depth.is_infinite() {
            found.num_out_of_view += 1;
        } else if depth - z > band_m {
            found.num_see_through += 1;
        } else if z - depth > band_m {
            found.num_occluded += 1;
        } else {
            found.num_supported += 1;
            for detection in 0..num_detections {
                let is_on_it = masks[pixel] == detection as i32;
                found.num_supported_by[detection] += u32::from(is_on_it);
            }
        }
    }
    found
}

fn counts(num_detections: usize) -> DepthEvidence {
    DepthEvidence { num_supported_by: vec![0; num_detections], ..DepthEvidence::default() }
}

fn evidence(cloud: &[Point], depth_m: &[f32]) -> DepthEvidence {
    let image = MaskedDepth { camera: CAMERA, depth_m, masks: &[-1; NUM_PX] };
    depth_evidence([cloud], image, 0, &EvidenceConfig::default()).unwrap().remove(0)
}

/// A square of points, 0.4 m wide, upright at a distance straight ahead.
fn square(z_m: f32) -> Vec<Point> {
    let at = |i: u8| -0.2 + 0.02 * f32::from(i);
    (0..=20).flat_map(|i| (0..=20).map(move |j| [at(i), 1.5 + at(j), z_m])).collect()
}

fn depths() -> impl Strategy<Value = Vec<f32>> {
    let depth = prop_oneof![
        8 => 0.1_f32..8.0,
        1 => Just(f32::INFINITY),
        1 => Just(0.0_f32),
    ];
    vec(depth, NUM_PX)
}

proptest! {
    #[test]
    fn counts_are_those_of_the_plain_twin(
        clouds in vec(vec([-5.0_f32..5.0, -1.0_f32..4.0, -2.0_f32..8.0], 0..60), 0..6),
        depth_m in depths(),
        masks in vec(-1..3, NUM_PX),
        yaw_rad in -4.0..4.0,
        horizon_rad in -1.0..1.0,
        max_points in 1_usize..70,
        band_m in 0.0..0.5,
        band_share in 0.0..0.2,
    ) {
        let camera = Camera { yaw_rad, horizon_rad, ..CAMERA };
        let config = EvidenceConfig { max_points, band_m, band_share };
        let image = MaskedDepth { camera, depth_m: &depth_m, masks: &masks };
        let found = depth_evidence(clouds.iter().map(Vec::as_slice), image, 3, &config)?;
        let twin: Vec<_> = clouds
            .iter()
            .map(|cloud| depth_evidence_naive(cloud, image, 3, &config))
            .collect();
        prop_assert_eq!(&found, &twin);
        for (counts, cloud) in found.iter().zip(&clouds) {
            let sum = counts.num_see_through
                + counts.num_supported
                + counts.num_occluded
                + counts.num_out_of_view;
            prop_assert_eq!(sum as usize, cloud.len().min(max_points));
            prop_assert!(counts.num_supported_by.iter().sum::<u32>() <= counts.num_supported);
        }
    }
}

#[test]
fn points_are_seen_through_supported_or_occluded_by_what_is_at_their_pixel() {
    let cloud = square(2.0);
    assert_eq!(
        evidence(&cloud, &[2.11; NUM_PX]),
        DepthEvidence { num_see_through: 256, ..counts(0) }
    );
    for depth in [1.91, 2.0, 2.09] {
        let supported = DepthEvidence { num_supported: 256, ..counts(0) };
        assert_eq!(evidence(&cloud, &[depth; NUM_PX]), supported);
    }
    assert_eq!(evidence(&cloud, &[1.89; NUM_PX]), DepthEvidence { num_occluded: 256, ..counts(0) });
}

#[test]
fn the_band_grows_with_the_distance() {
    let cloud = square(7.0); // 2% of 7 m are 0.14 m
    assert_eq!(evidence(&cloud, &[7.13; NUM_PX]).num_supported, 256);
    assert_eq!(evidence(&cloud, &[7.15; NUM_PX]).num_see_through, 256);
}

#[test]
fn a_pixel_without_a_depth_and_a_place_outside_the_image_say_nothing() {
    let nothing = DepthEvidence { num_out_of_view: 256, ..counts(0) };
    assert_eq!(evidence(&square(2.0), &[f32::INFINITY; NUM_PX]), nothing);
    assert_eq!(evidence(&square(2.0), &[0.0; NUM_PX]), nothing);
    assert_eq!(evidence(&square(-2.0), &[4.0; NUM_PX]), nothing);
    assert_eq!(evidence(&[], &[4.0; NUM_PX]), counts(0));
}

#[test]
fn the_points_of_a_large_entry_are_taken_evenly() {
    // The second half of the points is behind the surface.
    let mut cloud = square(2.0);
    cloud.extend(square(5.0));
    let found = evidence(&cloud, &[2.0; NUM_PX]);
    assert_eq!((found.num_supported, found.num_occluded), (128, 128));
}

#[test]
fn supported_points_are_counted_by_the_detection_on_whose_surface_they_are() {
    // The left half of the image is one detection, the right half another; a third is not there.
    let masks: Vec<i32> = (0..NUM_PX).map(|i| i32::from(i % 40 >= 20)).collect();
    let cloud = square(2.0);
    let compared = |depth_m: f32| {
        let image = MaskedDepth { camera: CAMERA, depth_m: &[depth_m; NUM_PX], masks: &masks };
        depth_evidence([&cloud[..]], image, 3, &EvidenceConfig::default()).unwrap().remove(0)
    };
    let [left, right, third] = compared(2.0).num_supported_by[..] else { panic!() };
    assert_eq!((left + right, third), (256, 0));
    assert!(left > 100 && right > 100);
    assert_eq!(compared(5.0).num_supported_by, [0, 0, 0]);
}

#[test]
fn what_does_not_fit_is_named() {
    let (depth_m, masks) = (vec![1.0; NUM_PX], vec![1; NUM_PX]);
    let refused = |camera: Camera, depth_m: &[f32], num: usize, config: EvidenceConfig| {
        let image = MaskedDepth { camera, depth_m, masks: &masks };
        depth_evidence([&[][..]], image, num, &config).unwrap_err().to_string()
    };
    let config = EvidenceConfig::default();
    let mut with_nan = depth_m.clone();
    with_nan[7] = f32::NAN;
    assert!(refused(CAMERA, &depth_m[1..], 2, config).contains("depth_m"));
    assert!(refused(CAMERA, &with_nan, 2, config).contains("NaN"));
    assert!(refused(CAMERA, &depth_m, 1, config).contains("masks"));
    let no_camera = Camera { vertical_fov_rad: 0.0, ..CAMERA };
    assert!(refused(no_camera, &depth_m, 2, config).contains("vertical_fov_rad"));
    for (name, wrong) in [
        ("max_points", EvidenceConfig { max_points: 0, ..config }),
        ("band_m", EvidenceConfig { band_m: f64::NAN, ..config }),
        ("band_share", EvidenceConfig { band_share: 1.5, ..config }),
    ] {
        assert!(refused(CAMERA, &depth_m, 2, wrong).contains(name));
    }
}

#[test]
fn a_map_compares_the_entries_asked_for_and_names_an_unknown_one() {
    let mut map = ObjectMap::new(ObjectMapConfig::default()).unwrap();
    let (depth_m, masks) = (vec![2.0; NUM_PX], vec![0; NUM_PX]);
    let image = MaskedDepth { camera: CAMERA, depth_m: &depth_m, masks: &masks };
    let labels = ["Box".to_owned()];
    let view = DetectedView { image, labels: &labels, confidences: &[1.0], features: &[] };
    map.update(&view).unwrap();
    let config = EvidenceConfig::default();
    let id = map.entries()[0].id;
    let there = map.depth_evidence(&[id, id], image, 1, &config).unwrap();
    assert_eq!(there.len(), 2);
    assert_eq!((there[0].num_supported, there[1].num_supported), (256, 256));
    assert_eq!(there[0].num_supported_by, [256]);
    let farther = MaskedDepth { depth_m: &[4.0; NUM_PX], ..image };
    assert_eq!(map.depth_evidence(&[id], farther, 1, &config).unwrap()[0].num_see_through, 256);
    let unknown = map.depth_evidence(&[id, 99], image, 1, &config).unwrap_err();
    assert!(unknown.to_string().contains("99"), "{unknown}");
}
