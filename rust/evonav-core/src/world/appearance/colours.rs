//! Surfaces of any colour.

use std::collections::BTreeMap;

use crate::{
    assets::{material::MaterialKind, part::Part},
    rng::Stream,
    world::{
        appearance::{change::Surfaces, subject::Subject},
        scene::Body,
    },
};

/// Factors between which a part's brightness stays relative to that of its material, so that seams
/// and shadows are still seen.
const SHADES: [f64; 2] = [0.5, 1.4];

/// Give each material of a body one colour of any hue, as bright and as strong as AI2-THOR's.
pub(super) fn colour(change: &Surfaces, subject: &Subject<'_>, body: &mut Body) {
    let mut averages: BTreeMap<u8, (f64, f64)> = BTreeMap::new();
    for part in body.parts.iter().chain(&body.trim) {
        let (sum, count) = averages.entry(group(part)).or_default();
        *sum += luminance(part.colour);
        *count += 1.0;
    }
    let stream = Stream::new(change.seed, &["colors", subject.look]);
    for part in body.parts.iter_mut().chain(&mut body.trim) {
        let (sum, count) = averages.get(&group(part)).copied().unwrap_or((1.0, 1.0));
        let mut draws = stream.at(&[i64::from(group(part))]);
        let (hue, saturation, value) =
            (draws.uniform(), 0.5 + 0.5 * draws.uniform(), 0.5 + 0.5 * draws.uniform());
        let shade = (luminance(part.colour) / (sum / count).max(1.0)).clamp(SHADES[0], SHADES[1]);
        part.colour = rgb_of_hsv([hue, saturation, value])
            .map(|channel| (255.0 * channel * shade).round().clamp(0.0, 255.0) as u8);
    }
}

/// Return the number of a part's material in its body: what is painted and what is wood may differ.
fn group(part: &Part) -> u8 {
    match part.material.kind {
        MaterialKind::Panel | MaterialKind::Drawer => MaterialKind::Wood as u8,
        kind => kind as u8,
    }
}

fn luminance(colour: [u8; 3]) -> f64 {
    let [red, green, blue] = colour.map(f64::from);
    0.3 * red + 0.59 * green + 0.11 * blue
}

/// Convert hue, saturation and value, each 0 to 1, to red, green and blue.
pub(super) fn rgb_of_hsv([hue, saturation, value]: [f64; 3]) -> [f64; 3] {
    [5.0, 3.0, 1.0].map(|offset| {
        let place = (offset + 6.0 * hue) % 6.0;
        value * (1.0 - saturation * place.min(4.0 - place).clamp(0.0, 1.0))
    })
}
