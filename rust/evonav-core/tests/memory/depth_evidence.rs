//! Depth evidence, against a plain twin and by hand.

use evonav_core::{
    memory::objects::{
        DetectedView, ObjectMap, ObjectMapConfig,
        depth_evidence::{DepthEvidence, EvidenceConfig, depth_evidence},
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

/// Each point alone, by the camera's own projection.
fn depth_evidence_naive(
    cloud: &[Point],
    camera: &Camera,
    depth_m: &[f32],
    config: &EvidenceConfig,
) -> DepthEvidence {
    let num = cloud.len().min(config.max_points);
    let mut found = DepthEvidence::default();
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
        let depth = f64::from(depth_m[row as usize * camera.width_px + col as usize]);
        let band_m = f64::max(config.band_m, config.band_share * z);
        if depth <= 0.0 || depth.is_infinite() {
            found.num_out_of_view += 1;
        } else if depth - z > band_m {
            found.num_see_through += 1;
        } else if z - depth > band_m {
            found.num_occluded += 1;
        } else {
            found.num_supported += 1;
        }
    }
    found
}

fn evidence(cloud: &[Point], depth_m: &[f32]) -> DepthEvidence {
    depth_evidence([cloud], &CAMERA, depth_m, &EvidenceConfig::default()).unwrap()[0]
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
        yaw_rad in -4.0..4.0,
        horizon_rad in -1.0..1.0,
        max_points in 1_usize..70,
        band_m in 0.0..0.5,
        band_share in 0.0..0.2,
    ) {
        let camera = Camera { yaw_rad, horizon_rad, ..CAMERA };
        let config = EvidenceConfig { max_points, band_m, band_share };
        let found = depth_evidence(clouds.iter().map(Vec::as_slice), &camera, &depth_m, &config)?;
        let twin: Vec<_> = clouds
            .iter()
            .map(|cloud| depth_evidence_naive(cloud, &camera, &depth_m, &config))
            .collect();
        prop_assert_eq!(&found, &twin);
        for (counts, cloud) in found.iter().zip(&clouds) {
            let sum = counts.num_see_through
                + counts.num_supported
                + counts.num_occluded
                + counts.num_out_of_view;
            prop_assert_eq!(sum as usize, cloud.len().min(max_points));
        }
    }
}

#[test]
fn points_are_seen_through_supported_or_occluded_by_what_is_at_their_pixel() {
    let cloud = square(2.0);
    assert_eq!(
        evidence(&cloud, &[2.11; NUM_PX]),
        DepthEvidence { num_see_through: 256, ..Default::default() }
    );
    for depth in [1.91, 2.0, 2.09] {
        let supported = DepthEvidence { num_supported: 256, ..Default::default() };
        assert_eq!(evidence(&cloud, &[depth; NUM_PX]), supported);
    }
    assert_eq!(
        evidence(&cloud, &[1.89; NUM_PX]),
        DepthEvidence { num_occluded: 256, ..Default::default() }
    );
}

#[test]
fn the_band_grows_with_the_distance() {
    let cloud = square(7.0); // 2% of 7 m are 0.14 m
    assert_eq!(evidence(&cloud, &[7.13; NUM_PX]).num_supported, 256);
    assert_eq!(evidence(&cloud, &[7.15; NUM_PX]).num_see_through, 256);
}

#[test]
fn a_pixel_without_a_depth_and_a_place_outside_the_image_say_nothing() {
    let nothing = DepthEvidence { num_out_of_view: 256, ..Default::default() };
    assert_eq!(evidence(&square(2.0), &[f32::INFINITY; NUM_PX]), nothing);
    assert_eq!(evidence(&square(2.0), &[0.0; NUM_PX]), nothing);
    assert_eq!(evidence(&square(-2.0), &[4.0; NUM_PX]), nothing);
    assert_eq!(evidence(&[], &[4.0; NUM_PX]), DepthEvidence::default());
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
fn what_does_not_fit_is_named() {
    let depth_m = vec![1.0; NUM_PX];
    let refused = |camera: Camera, depth_m: &[f32], config: EvidenceConfig| {
        depth_evidence([&[][..]], &camera, depth_m, &config).unwrap_err().to_string()
    };
    let config = EvidenceConfig::default();
    let mut with_nan = depth_m.clone();
    with_nan[7] = f32::NAN;
    assert!(refused(CAMERA, &depth_m[1..], config).contains("depth_m"));
    assert!(refused(CAMERA, &with_nan, config).contains("NaN"));
    let no_camera = Camera { vertical_fov_rad: 0.0, ..CAMERA };
    assert!(refused(no_camera, &depth_m, config).contains("vertical_fov_rad"));
    for (name, wrong) in [
        ("max_points", EvidenceConfig { max_points: 0, ..config }),
        ("band_m", EvidenceConfig { band_m: f64::NAN, ..config }),
        ("band_share", EvidenceConfig { band_share: 1.5, ..config }),
    ] {
        assert!(refused(CAMERA, &depth_m, wrong).contains(name));
    }
}

#[test]
fn a_map_compares_the_entries_asked_for_and_names_an_unknown_one() {
    let mut map = ObjectMap::new(ObjectMapConfig::default()).unwrap();
    let (depth_m, masks) = (vec![2.0; NUM_PX], [0; NUM_PX]);
    let masks = RunImage::of(&masks, CAMERA.width_px).unwrap();
    let image = MaskedDepth { camera: CAMERA, depth_m: &depth_m, masks: &masks };
    let labels = ["Box".to_owned()];
    let view = DetectedView { image, labels: &labels, confidences: &[1.0], features: &[] };
    map.update(&view).unwrap();
    let config = EvidenceConfig::default();
    let id = map.entries()[0].id;
    let there = map.depth_evidence(&[id, id], &CAMERA, &depth_m, &config).unwrap();
    assert_eq!(there.len(), 2);
    assert_eq!((there[0].num_supported, there[1].num_supported), (256, 256));
    let gone = map.depth_evidence(&[id], &CAMERA, &[4.0; NUM_PX], &config).unwrap();
    assert_eq!(gone[0].num_see_through, 256);
    let unknown = map.depth_evidence(&[id, 99], &CAMERA, &depth_m, &config).unwrap_err();
    assert!(unknown.to_string().contains("99"), "{unknown}");
}
