//! Colours of materials, and plausible colours where the material is unknown.

use crate::assets::Asset;

/// Colour, sRGB.
pub type Colour = [u8; 3];

/// Colours of wood, light to dark.
pub const WOODS: [Colour; 6] =
    [[205, 170, 125], [176, 132, 86], [150, 105, 70], [120, 78, 48], [92, 60, 40], [188, 140, 100]];
/// Colours of upholstery.
pub const FABRICS: [Colour; 6] = [
    [130, 135, 145],
    [95, 105, 125],
    [165, 150, 130],
    [120, 75, 65],
    [100, 115, 100],
    [190, 180, 165],
];
pub const STEEL: Colour = [185, 188, 192];
pub const DARK: Colour = [45, 45, 48];
pub const CERAMIC: Colour = [240, 240, 238];

/// Hash a name by FNV-1a, so that an asset's choices do not change between runs or platforms.
pub fn hash(text: &str) -> u32 {
    text.bytes().fold(0x811c_9dc5, |h, byte| (h ^ u32::from(byte)).wrapping_mul(0x0100_0193))
}

/// Return the colour number `index` of an asset, or `otherwise` where there is none.
pub fn tint(asset: &Asset, index: usize, otherwise: Colour) -> Colour {
    asset.colours.get(index).copied().unwrap_or(otherwise)
}

/// Make a colour darker (`factor` below 1) or lighter.
pub fn shade(colour: Colour, factor: f64) -> Colour {
    colour.map(|channel| (f64::from(channel) * factor).round().clamp(0.0, 255.0) as u8)
}

/// Return the colour that a material shows indoors: black reflects a little and white not all.
pub fn lit(colour: Colour) -> Colour {
    colour.map(|channel| 24 + (f64::from(channel) * 0.9).round() as u8)
}

/// Return the lightest of an asset's colours: its shade, screen or cloth; `otherwise` if none is
/// light.
pub fn lightest(asset: &Asset, otherwise: Colour) -> Colour {
    let sum = |colour: &&Colour| colour.iter().map(|&c| u32::from(c)).sum::<u32>();
    asset.colours.iter().max_by_key(sum).filter(|c| sum(c) > 450).copied().unwrap_or(otherwise)
}

/// Return the most colourful of an asset's colours after the first; `otherwise` if all are dull.
pub fn liveliest(asset: &Asset, otherwise: Colour) -> Colour {
    let spread = |c: &&Colour| c.iter().max().zip(c.iter().min()).map_or(0, |(a, b)| a - b);
    let rest = asset.colours.iter().skip(1);
    rest.max_by_key(spread).filter(|c| spread(c) > 60).copied().unwrap_or(otherwise)
}
