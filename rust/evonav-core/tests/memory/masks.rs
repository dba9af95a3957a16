//! Masks of instances in images, counted pixel by pixel.

use evonav_core::sensors::{
    instance_masks::{MaskFilter, instance_areas, mask_extents, number_instances, renumber_masks},
    runs::RunImage,
};
use proptest::{collection::vec, prelude::*};

fn runs(pixels: &[i32], width_px: usize) -> RunImage {
    RunImage::of(pixels, width_px).unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..Default::default() })]

    #[test]
    fn areas_are_counts_of_equal_pixels(image in vec(0..6_i32, 0..60), num_more in 0..3_usize) {
        let row = runs(&image, image.len().max(1));
        let areas = instance_areas(&row, 5 + num_more).unwrap();
        let expected: Vec<i64> = (1..=5 + num_more as i32)
            .map(|value| image.iter().filter(|v| **v == value).count() as i64)
            .collect();
        prop_assert_eq!(areas, expected);
        let fits = image.iter().all(|&value| value <= 3);
        prop_assert_eq!(instance_areas(&row, 3).is_ok(), fits);
    }

    #[test]
    fn masks_extend_from_their_first_to_their_last_pixels(
        stretches in vec((-1..4_i32, 1..9_usize), 80),
    ) {
        let stretch = |&(mask, length): &(i32, usize)| std::iter::repeat_n(mask, length);
        let image: Vec<i32> = stretches.iter().flat_map(stretch).take(80).collect();
        let extents = mask_extents(&runs(&image, 10), 4).unwrap();
        for (mask, extent) in extents.iter().enumerate() {
            let pixels: Vec<usize> = (0..80).filter(|&i| image[i] == mask as i32).collect();
            let range = |f: fn(usize) -> usize| {
                let values = || pixels.iter().map(|&i| f(i));
                [values().min().unwrap_or(0), values().max().map_or(0, |last| last + 1)]
            };
            prop_assert_eq!(extent.area_px, pixels.len());
            prop_assert_eq!(extent.rows, range(|i| i / 10));
            prop_assert_eq!(extent.cols, range(|i| i % 10));
        }
    }

    #[test]
    fn renumbered_masks_are_those_of_a_table(
        stretches in vec((-1..4_i32, 1..90_usize), 60),
        width_px in 1..200_usize,
        numbers in vec(-1..9_i32, 4),
    ) {
        let stretch = |&(mask, length): &(i32, usize)| std::iter::repeat_n(mask, length);
        let mut image: Vec<i32> = stretches.iter().flat_map(stretch).collect();
        image.truncate(image.len() / width_px * width_px);
        let number = |&mask: &i32| usize::try_from(mask).map_or(-1, |mask| numbers[mask]);
        let expected: Vec<i32> = image.iter().map(number).collect();
        let masks = runs(&image, width_px);
        prop_assert_eq!(renumber_masks(&masks, &numbers).unwrap(), runs(&expected, width_px));
        let fits = image.iter().all(|&mask| mask < 3);
        prop_assert_eq!(renumber_masks(&masks, &numbers[..3]).is_ok(), fits);
    }

    #[test]
    fn detections_are_the_instances_that_pass_in_the_order_of_their_pixels(
        image in vec(0..6_i32, 8 * 10),
        is_detectable in vec(any::<bool>(), 5),
        min_area_px in 0..25_usize,
        max_box_fraction in 0.3..=1.0,
    ) {
        let filter = MaskFilter { min_area_px, max_box_fraction };
        let masks = number_instances(&runs(&image, 10), &is_detectable, filter).unwrap();
        let mut expected = Vec::new();
        for &value in image.iter().filter(|v| **v > 0) {
            let pixels: Vec<usize> = (0..80).filter(|&i| image[i] == value).collect();
            let extent = |f: fn(usize) -> usize| {
                let values = || pixels.iter().map(|&i| f(i));
                values().max().unwrap() - values().min().unwrap() + 1
            };
            let box_px = extent(|i| i / 10) * extent(|i| i % 10);
            let instance = value as usize - 1;
            if is_detectable[instance]
                && pixels.len() >= min_area_px
                && box_px as f64 <= max_box_fraction * 80.0
                && !expected.contains(&instance)
            {
                expected.push(instance);
            }
        }
        prop_assert_eq!(&masks.instances, &expected);
        for (label, value) in masks.labels.pixels().into_iter().zip(image) {
            let number = expected.iter().position(|&i| i as i32 + 1 == value);
            prop_assert_eq!(label, number.map_or(-1, |n| n as i32));
        }
    }
}

#[test]
fn images_that_do_not_fit_are_named() {
    let names =
        |name: &str, message: String| assert!(message.contains(&format!("`{name}`")), "{message}");
    let filter = MaskFilter { min_area_px: 1, max_box_fraction: 1.0 };
    for image in [[7, 0], [-1, 0], [i32::MAX, 0]] {
        names(
            "instances",
            number_instances(&runs(&image, 2), &[true], filter).unwrap_err().to_string(),
        );
        names("instances", instance_areas(&runs(&image, 2), 1).unwrap_err().to_string());
    }
    names("masks", mask_extents(&runs(&[0, 1], 2), 1).unwrap_err().to_string());
    names("masks", renumber_masks(&runs(&[0, 1], 2), &[0]).unwrap_err().to_string());
    names("pixels", RunImage::of(&[0, 0, 0], 2).unwrap_err().to_string());
}
