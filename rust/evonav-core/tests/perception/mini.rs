//! The small network against plain loops, and its instances against a plain flood fill.

use evonav_core::{
    Error,
    perception::mini::{
        convolution::{Conv, ConvShape, Tensor},
        instances::{MIN_AGREEMENT, MIN_LINK, Resemblance, refine, segments},
        network::{Network, SIDE_CELLS, SIDE_PX, input},
        weights::from_half,
    },
};
use proptest::{collection::vec, prelude::*};

/// Every output by itself, in the order that `Conv::run` promises.
fn convolved_naive(shape: ConvShape, weights: &[f32], bias: &[f32], image: &Tensor) -> Vec<f32> {
    let ConvShape { num_in, size, stride, is_depthwise, .. } = shape;
    let (half, area) = (size / 2, size * size);
    let pixel = |row: usize, col: usize, channel: usize| {
        let (row, col) = (row.checked_sub(half)?, col.checked_sub(half)?);
        let is_inside = row < image.height && col < image.width;
        is_inside.then(|| image.values[(row * image.width + col) * num_in + channel])
    };
    let mut out = Vec::new();
    for row in (0..image.height).step_by(stride) {
        for col in (0..image.width).step_by(stride) {
            for (output, bias) in bias.iter().enumerate() {
                let mut sum = *bias;
                for k in 0..area {
                    let inputs = if is_depthwise { output..output + 1 } else { 0..num_in };
                    for input in inputs {
                        let place = if is_depthwise { output } else { output * num_in + input };
                        let value = pixel(row + k / size, col + k % size, input).unwrap_or(0.0);
                        sum += value * weights[place * area + k];
                    }
                }
                out.push(sum);
            }
        }
    }
    out
}

type Case = (ConvShape, Vec<f32>, Vec<f32>, Tensor);

fn cases() -> impl Strategy<Value = Case> {
    let shape = (1..20_usize, 1..20_usize, 0..3_usize, 1..3_usize, any::<bool>());
    (shape, 1..12_usize, 1..14_usize).prop_flat_map(|(shape, height, width)| {
        let (num_in, num_out, half, stride, is_depthwise) = shape;
        let num_out = if is_depthwise { num_in } else { num_out };
        let shape = ConvShape { num_in, num_out, size: 2 * half + 1, stride, is_depthwise };
        let num_weights = shape.num_weights().expect("a sane shape");
        let numbers = |len| vec(-2.0_f32..2.0, len);
        (numbers(num_weights), numbers(num_out), numbers(height * width * num_in)).prop_map(
            move |(weights, bias, values)| {
                let image = Tensor { height, width, channels: num_in, values };
                (shape, weights, bias, image)
            },
        )
    })
}

/// Instances by flooding from each cell; cells that no flood reached are -1.
fn flooded_naive(logits: &Tensor) -> Vec<i32> {
    let (width, classes) = (logits.width, logits.channels - 3);
    let cell = |place: usize| &logits.values[place * logits.channels..][..logits.channels];
    let is_object = |place: usize| cell(place)[1..=classes].iter().any(|&v| v > cell(place)[0]);
    let powers = |place: usize| cell(place)[1..=classes].iter().map(|&v| f64::from(v).exp());
    let dot = |a: usize, b: usize| powers(a).zip(powers(b)).map(|(a, b)| a * b).sum::<f64>();
    let agree =
        |a: usize, b: usize| dot(a, b) > f64::from(MIN_AGREEMENT) * (dot(a, a) * dot(b, b)).sqrt();
    let mut found = vec![-1; logits.height * width];
    let mut next = 0;
    for start in 0..found.len() {
        if found[start] >= 0 || !is_object(start) {
            continue;
        }
        let mut open = vec![start];
        while let Some(place) = open.pop() {
            if found[place] == next {
                continue;
            }
            found[place] = next;
            for other in (0..found.len()).filter(|&other| is_object(other)) {
                let (low, high) = (place.min(other), place.max(other));
                let is_beside = high == low + 1 && high % width != 0;
                let is_linked = (is_beside && cell(low)[classes + 1] > MIN_LINK)
                    || (high == low + width && cell(low)[classes + 2] > MIN_LINK);
                if is_linked && agree(low, high) {
                    open.push(other);
                }
            }
        }
        next += 1;
    }
    found
}

proptest! {
    #[test]
    fn convolutions_are_what_plain_loops_make((shape, weights, bias, image) in cases()) {
        let conv = Conv::new(shape, &weights, &bias).expect("weights that fit");
        let out = conv.run(&image).expect("an image that fits");
        prop_assert_eq!(out.values, convolved_naive(shape, &weights, &bias, &image));
    }

    #[test]
    fn instances_are_what_a_flood_fill_finds(
        (height, width, classes, values) in (1..7_usize, 1..7_usize, 1..4_usize).prop_flat_map(
            |(h, w, c)| (Just(h), Just(w), Just(c), vec(-3.0_f32..3.0, h * w * (c + 3))))
    ) {
        let logits = Tensor { height, width, channels: classes + 3, values };
        let found = segments(&logits, 0, 0.0).expect("good thresholds");
        let expected = flooded_naive(&logits);
        prop_assert_eq!(&found.cells, &expected);
        // Each is called by the class of the highest mean probability.
        for (instance, (&class, &confidence)) in found.classes.iter().zip(&found.confidences).enumerate() {
            let mut shares = vec![0.0_f64; classes];
            let mut num_cells = 0.0;
            for place in (0..expected.len()).filter(|&p| expected[p] == instance as i32) {
                let cell = &logits.values[place * (classes + 3)..][..=classes];
                let total: f64 = cell.iter().map(|&v| f64::from(v).exp()).sum();
                for (share, &logit) in shares.iter_mut().zip(&cell[1..]) {
                    *share += f64::from(logit).exp() / total;
                }
                num_cells += 1.0;
            }
            let most = shares.iter().copied().fold(0.0, f64::max) / num_cells;
            prop_assert!((f64::from(confidence) - most).abs() < 1e-5);
            prop_assert!((shares[class] / num_cells - most).abs() < 1e-5);
        }
        // Thresholds drop, and change nothing else.
        let strict = segments(&logits, 2, 0.5).expect("good thresholds");
        let num_cells = |of: i32| found.cells.iter().filter(|&&cell| cell == of).count();
        let kept: Vec<usize> = (0..found.classes.len())
            .filter(|&i| num_cells(i as i32) >= 2 && found.confidences[i] >= 0.5)
            .collect();
        prop_assert_eq!(strict.confidences, kept.iter().map(|&i| found.confidences[i]).collect::<Vec<_>>());
    }

    #[test]
    fn no_file_makes_the_reader_panic(bytes in vec(any::<u8>(), 0..200), len in 0..200_u32) {
        let header = br#"{"format":"evonav-mini/2","classes":["A"],"layers":[{"name":"stem","num_in":6,"num_out":2,"size":3,"stride":2,"is_depthwise":false}]}"#;
        let with_len = [b"EVONAVNN".as_slice(), &len.to_le_bytes(), &bytes].concat();
        let with_header =
            [b"EVONAVNN".as_slice(), &(header.len() as u32).to_le_bytes(), header, &bytes].concat();
        for file in [bytes, with_len, with_header] {
            let is_refused = matches!(Network::read(&file), Err(Error::InvalidArgument { .. }));
            prop_assert!(is_refused);
        }
    }

    #[test]
    fn pixels_take_the_instance_of_a_cell_around_them(
        (size, seed) in ((1..40_usize, 1..40_usize), any::<u64>())
    ) {
        let (width, height) = size;
        let cell = |i: usize| ((i as u64).wrapping_mul(seed | 1) >> 7) % 3;
        let cells: Vec<i32> = (0..SIDE_CELLS * SIDE_CELLS).map(|i| cell(i) as i32 - 1).collect();
        let rgb = vec![90; 3 * width * height];
        let depth_m = vec![2.0; width * height];
        let masks = refine(&cells, &rgb, &depth_m, [width, height], Resemblance::default());
        let masks = masks.expect("pixels that fit");
        prop_assert_eq!(masks.len(), width * height);
        prop_assert!(masks.iter().all(|mask| (-1..2).contains(mask)));
    }
}

#[test]
fn outlines_follow_colours() {
    // The left half of a picture is red, up to a line that is no cell's edge; cells left of it are 0.
    let [width, height, edge] = [300, 300, 149];
    let rgb: Vec<u8> = (0..width * height)
        .flat_map(|p| if p % width < edge { [200, 10, 10] } else { [10, 10, 200] })
        .collect();
    let cells: Vec<i32> = (0..SIDE_CELLS * SIDE_CELLS)
        .map(|cell| if cell % SIDE_CELLS * 4 + 1 < edge { 0 } else { -1 })
        .collect();
    let depth_m = vec![f32::INFINITY; width * height];
    let masks = refine(&cells, &rgb, &depth_m, [width, height], Resemblance::default());
    let masks = masks.expect("pixels that fit");
    let is_right = |(p, &mask): (usize, &i32)| mask == if p % width < edge { 0 } else { -1 };
    assert!(masks.iter().enumerate().all(is_right));
}

#[test]
fn halves_are_numbers() {
    let cases = [(0x3c00, 1.0), (0xc000, -2.0), (0x3555, 0.333_251_95), (0x0001, 5.960_464_5e-8)];
    for (half, number) in cases {
        assert_eq!(from_half(half), number);
    }
    assert_eq!(from_half(0x7bff), 65504.0);
    assert!(from_half(0x7c00).is_infinite() && from_half(0x7e00).is_nan());
}

#[test]
fn a_picture_of_any_size_is_an_input() {
    for [width, height] in [[1, 1], [7, 301], [300, 300]] {
        let depth_m = vec![f32::INFINITY; width * height];
        let made = input(&vec![255; 3 * width * height], &depth_m, [width, height], 0.0);
        let made = made.expect("a picture");
        assert_eq!(made.shape(), [SIDE_PX, SIDE_PX, 6]);
        assert!(made.values.iter().all(|value| value.is_finite()));
    }
    assert!(input(&[0; 3], &[f32::NAN], [1, 1], 0.0).is_err());
    assert!(input(&[0; 2], &[1.0], [1, 1], 0.0).is_err());
    assert!(input(&[], &[], [0, 5], 0.0).is_err());
    assert!(input(&[0; 3], &[1.0], [usize::MAX, 2], 0.0).is_err());
    assert!(input(&[0; 3], &[1.0], [1, 1], f64::NAN).is_err());
}

/// What lies on the floor is as far below a camera that looks down as below one that looks ahead.
#[test]
fn height_is_measured_from_the_camera_and_not_from_its_axis() {
    let floor_m = 1.5;
    for horizon_rad in [-0.2_f64, 0.0, 0.3, 0.6] {
        let rows = 0..SIDE_PX;
        let slopes = rows.map(|i| (2 * i + 1) as f64 / SIDE_PX as f64 - 1.0);
        let below = slopes.map(|slope| horizon_rad.sin() + horizon_rad.cos() * slope);
        let depth_m: Vec<f32> = below
            .flat_map(|below| {
                [if below > 0.1 { (floor_m / below) as f32 } else { f32::INFINITY }; SIDE_PX]
            })
            .collect();
        let rgb = vec![0; 3 * depth_m.len()];
        let made = input(&rgb, &depth_m, [SIDE_PX; 2], horizon_rad).expect("a picture");
        let (mut seen, mut high) = (0, 0);
        for (pixel, z_m) in made.values.as_chunks::<6>().0.iter().zip(&depth_m) {
            if z_m.is_finite() {
                seen += 1;
                assert!((f64::from(pixel[4]) - floor_m).abs() < 1e-4, "{horizon_rad}: {pixel:?}");
            } else {
                high += usize::from(pixel[4] <= 2.0);
            }
        }
        assert!(seen > SIDE_PX * SIDE_PX / 4 && high > 0);
    }
}
