//! Simulated errors against plain twins, and their rates.

use evonav_core::{
    perception::{
        depth_noise::{DepthNoise, noisy_depth},
        false_detections::{Blob, SiteNoise, paint_blobs, surface_sites},
        mask_distortion::{MaskChange, distort_masks},
        mask_outlines::{Outline, mask_outlines},
    },
    rng::Stream,
    sensors::camera::Camera,
};
use proptest::{collection::vec, prelude::*};

const ROWS: i32 = 9;
const COLS: i32 = 11;
const NUM_MASKS: usize = 4;

fn at<T: Copy>(image: &[T], row: i32, col: i32) -> Option<T> {
    let is_in = (0..ROWS).contains(&row) && (0..COLS).contains(&col);
    is_in.then(|| image[(row * COLS + col) as usize])
}

fn places() -> impl Iterator<Item = (i32, i32)> {
    (0..ROWS).flat_map(|row| (0..COLS).map(move |col| (row, col)))
}

/// Every pixel against every other.
fn distort_naive(masks: &[i32], changes: &[MaskChange]) -> Vec<i32> {
    let change_of = |mask: i32| usize::try_from(mask).ok().map(|mask| changes[mask]);
    let mut found = Vec::new();
    for (row, col) in places() {
        let own = at(masks, row, col).unwrap_or(-1);
        let others = || places().filter_map(|(r, c)| Some(((r, c), at(masks, r, c)?)));
        let square = |r: i32, c: i32| (r - row).pow(2) + (c - col).pow(2);
        let within = |r, c, margin: f64| f64::from(square(r, c)) <= margin * margin;
        let gained = others()
            .filter(|&((r, c), mask)| {
                mask != own
                    && change_of(mask).is_some_and(|change| {
                        change.becomes >= 0
                            && change.margin_px > 0.0
                            && within(r, c, change.margin_px)
                    })
            })
            .map(|((r, c), mask)| (square(r, c), mask))
            .min();
        let is_lost = change_of(own).is_some_and(|change| {
            change.margin_px < 0.0
                && others().any(|((r, c), mask)| mask != own && within(r, c, change.margin_px))
        });
        let mask = gained.map_or(if is_lost { -1 } else { own }, |(_, mask)| mask);
        found.push(change_of(mask).map_or(-1, |change| {
            let [top, left, bottom, right] = change.crop_px;
            let along = if change.is_split_by_col { col } else { row };
            let number = if along < change.split_px { change.becomes } else { change.rest_becomes };
            if row < top || row >= bottom || col < left || col >= right {
                -1
            } else {
                number.max(-1)
            }
        }));
    }
    found
}

fn outlines_naive(masks: &[i32], depth_m: &[f32]) -> Vec<Outline> {
    (0..NUM_MASKS as i32)
        .map(|mask| {
            let own: Vec<_> = places().filter(|&(r, c)| at(masks, r, c) == Some(mask)).collect();
            let mut outline = Outline { mean_depth_m: f64::INFINITY, ..Outline::default() };
            for &(r, c) in &own {
                let depth = f64::from(depth_m[(r * COLS + c) as usize]);
                for (dr, dc) in [(0, 1), (1, 0), (0, -1), (-1, 0)] {
                    if at(masks, r + dr, c + dc) == Some(mask) {
                        continue;
                    }
                    outline.num_sides += 1;
                    let is_cut = at(depth_m, r + dr, c + dc)
                        .is_none_or(|there| f64::from(there) < 0.95 * depth - 0.05);
                    outline.num_cut += usize::from(is_cut);
                }
            }
            if !own.is_empty() {
                let sum: f64 =
                    own.iter().map(|&(r, c)| f64::from(depth_m[(r * COLS + c) as usize])).sum();
                outline.mean_depth_m = sum / own.len() as f64;
            }
            outline
        })
        .collect()
}

prop_compose! {
    /// Rectangles over one another, so that masks have insides.
    fn masks()(boxes in vec((0..ROWS, 0..COLS, 1..6_i32, 1..6_i32, -1..NUM_MASKS as i32), 0..7)) -> Vec<i32> {
        let mut image = vec![-1; (ROWS * COLS) as usize];
        for (top, left, height, width, mask) in boxes {
            for (row, col) in places() {
                if (top..top + height).contains(&row) && (left..left + width).contains(&col) {
                    image[(row * COLS + col) as usize] = mask;
                }
            }
        }
        image
    }
}

prop_compose! {
    fn change()(
        becomes in -1..6_i32,
        rest in prop::option::of(0..6_i32),
        is_split_by_col in any::<bool>(),
        split_px in 0..10_i32,
        margin_px in prop_oneof![Just(0.0), -3.0..3.0, Just(1.0), Just(-1.0)],
        crop in prop::option::of((0..4_i32, 0..4_i32, 4..10_i32, 4..12_i32)),
    ) -> MaskChange {
        let whole = MaskChange::renamed(becomes);
        MaskChange {
            rest_becomes: rest.filter(|_| becomes >= 0).unwrap_or(becomes),
            is_split_by_col,
            split_px,
            margin_px,
            crop_px: crop.map_or(whole.crop_px, |(top, left, bottom, right)| [top, left, bottom, right]),
            ..whole
        }
    }
}

proptest! {
    #[test]
    fn masks_are_distorted_as_pixel_by_pixel(masks in masks(), changes in vec(change(), NUM_MASKS)) {
        let found = distort_masks(&masks, COLS as usize, &changes).unwrap();
        prop_assert_eq!(found, distort_naive(&masks, &changes));
    }

    #[test]
    fn outlines_are_counted_as_pixel_by_pixel(
        masks in masks(),
        depth_m in vec((1..40_u8).prop_map(|tenths| f32::from(tenths) / 10.0), (ROWS * COLS) as usize),
    ) {
        let found = mask_outlines(&masks, &depth_m, COLS as usize, NUM_MASKS).unwrap();
        for (one, twin) in found.iter().zip(outlines_naive(&masks, &depth_m)) {
            prop_assert_eq!((one.num_sides, one.num_cut), (twin.num_sides, twin.num_cut));
            prop_assert!(one.mean_depth_m == twin.mean_depth_m
                || (one.mean_depth_m - twin.mean_depth_m).abs() < 1e-9);
        }
    }

    #[test]
    fn blobs_are_ellipses_of_one_surface(
        surfaces in masks(),
        row in 0..ROWS, col in 0..COLS, down in 0.4..5.0, right in 0.4..5.0,
    ) {
        let mut painted = vec![-1; surfaces.len()];
        let blob = Blob { pixel: [row as usize, col as usize], radii_px: [down, right], number: 7 };
        paint_blobs(&mut painted, &surfaces, COLS as usize, &[blob]).unwrap();
        for (r, c) in places() {
            let share = (f64::from(r - row) / down).powi(2) + (f64::from(c - col) / right).powi(2);
            let is_in = share <= 1.0 && at(&surfaces, r, c) == at(&surfaces, row, col);
            prop_assert_eq!(at(&painted, r, c), Some(if is_in { 7 } else { -1 }));
        }
    }

    #[test]
    fn depth_noise_is_bounded_and_spares_what_has_no_depth(
        depth_m in vec(prop_oneof![Just(f32::INFINITY), Just(0.0_f32), 0.2_f32..9.0], 24),
        sigma_per_m in 0.0..0.01_f64, step_per_m in 0.0..0.01_f64, reach_m in 1.0..12.0_f64,
    ) {
        let noise = DepthNoise { sigma_per_m, step_per_m, max_depth_m: reach_m, ..SHARP };
        let found = noisy_depth(&depth_m, 6, &noise, &Stream::new(1, &["depth"])).unwrap();
        for (&was, &is) in depth_m.iter().zip(&found) {
            let was_m = f64::from(was);
            if was_m > 0.0 && was_m <= reach_m {
                let most_m = (3.5 * sigma_per_m + step_per_m) * was_m * was_m + 1e-5;
                prop_assert!((f64::from(is) - was_m).abs() <= most_m, "{was} {is} {most_m}");
            } else {
                prop_assert_eq!(is, f32::INFINITY);
            }
        }
    }
}

const SHARP: DepthNoise = DepthNoise {
    sigma_m: 0.0,
    sigma_per_m: 0.0,
    step_per_m: 0.0,
    dropout: 0.0,
    edge_dropout: 0.0,
    max_depth_m: f64::INFINITY,
};

#[test]
fn without_parameters_depth_stays_to_the_bit() {
    let depth_m: Vec<f32> = (1..60).map(|n| n as f32 / 7.0).collect();
    assert_eq!(noisy_depth(&depth_m, 59, &SHARP, &Stream::new(1, &[])).unwrap(), depth_m);
}

#[test]
fn depth_errs_at_its_rates() {
    let depth_m = vec![4.0_f32; 200 * 200];
    let noise = DepthNoise { sigma_m: 0.01, sigma_per_m: 0.0014, dropout: 0.1, ..SHARP };
    let found = noisy_depth(&depth_m, 200, &noise, &Stream::new(5, &["depth"])).unwrap();
    let kept: Vec<f64> = found.iter().filter(|d| d.is_finite()).map(|&d| f64::from(d)).collect();
    let num = kept.len() as f64;
    assert!((num / 40_000.0 - 0.9).abs() < 0.01, "{num}");
    let mean = kept.iter().sum::<f64>() / num;
    let sigma_m = (kept.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / num).sqrt();
    assert!((mean - 4.0).abs() < 0.001, "{mean}");
    assert!((sigma_m - (0.01 + 0.0014 * 16.0)).abs() < 0.001, "{sigma_m}");
    // Steps: 4.48 cm at 4 m, so that values are multiples of it.
    let stepped = DepthNoise { step_per_m: 0.0028, ..noise };
    let found = noisy_depth(&depth_m, 200, &stepped, &Stream::new(5, &["depth"])).unwrap();
    for value in found.iter().filter(|d| d.is_finite()) {
        let steps = f64::from(*value) / (0.0028 * 16.0);
        assert!((steps - steps.round()).abs() < 1e-4, "{steps}");
    }
    // A wall 4 m away with a post before it: only the columns beside the border are at an edge.
    let post: Vec<f32> = (0..40_000).map(|n| if n % 200 < 100 { 4.0 } else { 2.0 }).collect();
    let edges = DepthNoise { edge_dropout: 1.0, ..SHARP };
    let found = noisy_depth(&post, 200, &edges, &Stream::new(5, &["depth"])).unwrap();
    for (index, value) in found.iter().enumerate() {
        assert_eq!(value.is_infinite(), [99, 100].contains(&(index % 200)), "{index}");
    }
}

fn camera(yaw_rad: f64) -> Camera {
    Camera {
        width_px: 60,
        height_px: 60,
        vertical_fov_rad: std::f64::consts::FRAC_PI_2,
        position_m: [0.0, 1.5, 0.0],
        yaw_rad,
        horizon_rad: 0.0,
    }
}

fn sites_of(camera: &Camera, persistence: f64, round: &str) -> Vec<(f64, [f64; 2], f64)> {
    let noise = SiteNoise {
        cell_m: 0.25,
        stride_px: 2,
        persistence,
        lasting: Stream::new(3, &["lasting"]),
        passing: Stream::new(3, &["passing", round]),
    };
    // A wall at z = 2 m, straight ahead.
    let found = surface_sites(&vec![2.0; 3600], camera, &noise).expect("a valid view");
    found.iter().map(|site| (site.latent, site.what, site.how)).collect()
}

#[test]
fn places_keep_what_lasts_and_draw_the_rest_anew() {
    let (first, second) = (sites_of(&camera(0.0), 1.0, "1"), sites_of(&camera(0.0), 1.0, "2"));
    // Four metres square in cells of 0.25 m, one more where the wall lies on a border of cells.
    assert!((256..=17 * 17).contains(&first.len()), "{}", first.len());
    assert!(first.iter().zip(&second).all(|(a, b)| a.0 == b.0 && a.1 == b.1 && a.2 != b.2));
    let (first, second) = (sites_of(&camera(0.0), 0.0, "1"), sites_of(&camera(0.0), 0.0, "2"));
    assert!(first.iter().zip(&second).all(|(a, b)| a.0 != b.0 && a.1 == b.1));
    let half = |round| sites_of(&camera(0.0), 0.5, round);
    let pairs: Vec<_> = half("1").iter().zip(half("2")).map(|(a, b)| a.0 * b.0).collect();
    let correlation = pairs.iter().sum::<f64>() / pairs.len() as f64;
    assert!((correlation - 0.5).abs() < 0.2, "{correlation}");
}

#[test]
fn draws_are_standard_normal_and_places_are_apart() {
    let mut stream = Stream::new(9, &["normal"]);
    let drawn: Vec<f64> = (0..40_000).map(|_| stream.normal()).collect();
    let moment = |power: i32| drawn.iter().map(|v| v.powi(power)).sum::<f64>() / 40_000.0;
    for (power, expected, within) in [(1, 0.0, 0.02), (2, 1.0, 0.03), (3, 0.0, 0.08), (4, 3.0, 0.2)]
    {
        assert!((moment(power) - expected).abs() < within, "{power} {}", moment(power));
    }
    let base = Stream::new(9, &["place"]);
    // Nowhere is a place too.
    let mut seen: Vec<u64> = vec![base.clone().next_u64(), base.at(&[]).next_u64()];
    for x in -20..20 {
        for z in -20..20 {
            seen.push(base.at(&[x, z]).next_u64());
        }
        seen.push(base.at(&[x]).next_u64());
        seen.push(base.at(&[x, 0, 0]).next_u64());
    }
    let num = seen.len();
    seen.sort_unstable();
    seen.dedup();
    assert_eq!(seen.len(), num);
}

#[test]
fn bad_arguments_are_named() {
    let masks = vec![0; 12];
    let told = |margin_px| {
        let change = MaskChange { margin_px, ..MaskChange::renamed(0) };
        distort_masks(&masks, 4, &[change]).unwrap_err().to_string()
    };
    assert!(told(f64::NAN).contains("margin_px"));
    assert!(told(100.0).contains("margin_px"));
    assert!(distort_masks(&masks, 5, &[MaskChange::renamed(0)]).is_err());
    assert!(distort_masks(&masks, 4, &[]).unwrap_err().to_string().contains("masks"));
    assert!(mask_outlines(&masks, &[1.0; 11], 4, 1).unwrap_err().to_string().contains("depth_m"));
    let noise = DepthNoise { dropout: 2.0, ..SHARP };
    let stream = Stream::new(0, &[]);
    assert!(noisy_depth(&[1.0], 1, &noise, &stream).unwrap_err().to_string().contains("dropout"));
    assert!(noisy_depth(&[f32::NAN], 1, &SHARP, &stream).unwrap_err().to_string().contains("NaN"));
    let blob = Blob { pixel: [usize::MAX, 0], radii_px: [1.0, 1.0], number: 0 };
    assert!(
        paint_blobs(&mut [0; 4], &[0; 4], 2, &[blob]).unwrap_err().to_string().contains("pixel")
    );
    let far = Blob { pixel: [0, 0], radii_px: [1e300, 1e300], number: 1 };
    let mut whole = [0; 4];
    paint_blobs(&mut whole, &[5; 4], 2, &[far]).unwrap();
    assert_eq!(whole, [1; 4]);
}
