//! Colours: what materials are known to be, and what is plausible where they tell nothing.

use crate::assets::Asset;

/// Colour, sRGB.
pub type Colour = [u8; 3];

/// Woods, light to dark.
pub const WOODS: [Colour; 6] =
    [[205, 170, 125], [176, 132, 86], [150, 105, 70], [120, 78, 48], [92, 60, 40], [188, 140, 100]];
/// Upholstery.
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

/// FNV-1a: which of some choices an asset gets must not change between runs or platforms.
pub fn hash(text: &str) -> u32 {
    text.bytes().fold(0x811c_9dc5, |h, byte| (h ^ u32::from(byte)).wrapping_mul(0x0100_0193))
}

/// Colour number `index` of an asset, or `otherwise` where there is none.
pub fn tint(asset: &Asset, index: usize, otherwise: Colour) -> Colour {
    asset.colours.get(index).copied().unwrap_or(otherwise)
}

/// A colour made darker (below 1) or lighter.
pub fn shade(colour: Colour, factor: f64) -> Colour {
    colour.map(|channel| (f64::from(channel) * factor).round().clamp(0.0, 255.0) as u8)
}
