//! The appearance of a target in its reference image, from its shape and the catalogue.

use crate::{
    assets::{
        Asset,
        shapes::{lit, shape_in, shape_traits},
    },
    generation::record::{Appearance, Tint},
    house::Condition,
    sensors::raster::FrameBuffer,
};

/// Largest number of a target's pixels that are used: enough for shares to one or two hundredths.
const MAX_PIXELS: usize = 2000;

/// Describe colours, form, parts and materials of a target.
///
/// # Arguments
/// * `asset`, `condition` - asset and state of the target.
/// * `frame` - the reference image with its instances.
/// * `body` - instance id of the target in it.
pub fn appearance_of(
    asset: &Asset,
    condition: Condition,
    frame: &FrameBuffer,
    body: i32,
) -> Appearance {
    let traits = shape_traits(asset, condition);
    Appearance {
        tints: tints(asset, condition, frame, body),
        form: traits.form,
        details: traits.details,
        made_of: asset.made_of.clone(),
    }
}

/// Return the colours of the target's materials and their shares of its visible pixels, largest
/// first.
///
/// Light and shade change the brightness of a pixel, but hardly its hue. Each pixel counts for the
/// material whose colour, made brighter or darker, is nearest to it.
fn tints(asset: &Asset, condition: Condition, frame: &FrameBuffer, body: i32) -> Vec<Tint> {
    let mut colours: Vec<[u8; 3]> =
        shape_in(asset, condition).iter().map(|part| part.colour).collect();
    colours.sort_unstable();
    colours.dedup();
    let pixels: Vec<[f64; 3]> = frame
        .rgb
        .chunks_exact(3)
        .zip(&frame.instances)
        .filter(|(_, id)| **id == body)
        .map(|(pixel, _)| [0, 1, 2].map(|i| f64::from(pixel[i])))
        .collect();
    let step = pixels.len().div_ceil(MAX_PIXELS).max(1);
    let mut counts = vec![0_usize; colours.len()];
    for pixel in pixels.iter().step_by(step) {
        let distances = colours.iter().map(|&colour| distance(*pixel, colour.map(f64::from)));
        let nearest = distances.enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
        if let Some((index, _)) = nearest {
            counts[index] += 1;
        }
    }
    let total = counts.iter().sum::<usize>().max(1);
    let mut tints: Vec<Tint> = colours
        .into_iter()
        .zip(counts)
        .filter(|&(_, count)| count > 0)
        .map(|(colour, count)| Tint {
            colour: unlit(colour),
            share: (100.0 * count as f64 / total as f64).round() / 100.0,
        })
        .collect();
    tints.sort_by(|a, b| b.share.total_cmp(&a.share).then(a.colour.cmp(&b.colour)));
    tints
}

/// Return the squared distance of a pixel from a colour at the brightness that fits best, between
/// half and full light. A darker colour has a small penalty, so that of two colours of one hue the
/// more likely one counts.
fn distance(pixel: [f64; 3], colour: [f64; 3]) -> f64 {
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let light = (dot(pixel, colour) / dot(colour, colour).max(1.0)).clamp(0.45, 1.15);
    let off: f64 = (0..3).map(|i| (pixel[i] - light * colour[i]).powi(2)).sum();
    off + 200.0 * (light - 0.9).powi(2)
}

/// Return the colour of a material from the colour that it shows indoors.
fn unlit(colour: [u8; 3]) -> [u8; 3] {
    let [black, white] = [lit([0; 3])[0], lit([255; 3])[0]].map(f64::from);
    colour.map(|channel| {
        (255.0 * (f64::from(channel) - black) / (white - black)).round().clamp(0.0, 255.0) as u8
    })
}
