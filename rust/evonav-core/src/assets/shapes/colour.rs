//! Colours: what materials are known to be, and what is plausible where they tell nothing.

use crate::assets::{Asset, catalogue::Catalogue};

/// Colour, sRGB.
pub type Colour = [u8; 3];

/// Woods, light to dark.
pub const WOODS: [Colour; 6] = [
    [205, 170, 125],
    [176, 132, 86],
    [150, 105, 70],
    [120, 78, 48],
    [92, 60, 40],
    [188, 140, 100],
];
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

/// Whether a colour is the white that textured materials carry as their albedo.
fn is_blank(colour: Colour) -> bool {
    colour.iter().all(|&channel| channel >= 248)
}

/// Colour number `index` of an asset, or `otherwise` where there is none or it is blank.
pub fn tint(asset: &Asset, index: usize, otherwise: Colour) -> Colour {
    asset.colours.get(index).copied().filter(|&colour| !is_blank(colour)).unwrap_or(otherwise)
}

/// A colour made darker (below 1) or lighter.
pub fn shade(colour: Colour, factor: f64) -> Colour {
    colour.map(|channel| (f64::from(channel) * factor).round().clamp(0.0, 255.0) as u8)
}

/// Colour of a floor's or wall's material; blank albedos (the colour is in a texture that is not
/// published) are guessed from the name; `otherwise` if the catalogue does not know it.
pub(crate) fn surface_colour(material: &str, catalogue: &Catalogue, otherwise: Colour) -> Colour {
    match catalogue.material_colour(material) {
        Some(colour) if is_blank(colour) => named(material).unwrap_or([245, 244, 240]),
        Some(colour) => colour,
        None => otherwise,
    }
}

fn named(material: &str) -> Option<Colour> {
    let name = material.to_ascii_lowercase();
    let has = |word: &str| name.contains(word);
    let hints: [(bool, Colour); 10] = [
        (has("white") || has("clean"), [240, 238, 232]),
        (has("fireplacebrick") || has("redbrick"), [150, 80, 62]),
        (has("brick"), [165, 105, 85]),
        (has("dark") && has("wood"), [88, 60, 42]),
        (has("pale"), [214, 190, 155]),
        (has("wood") || has("beams") || has("cabinet"), [172, 128, 86]),
        (has("grey") || has("concrete"), [165, 165, 162]),
        (has("carpet"), [170, 160, 148]),
        (has("marble"), [226, 220, 212]),
        (has("tile") || has("kitchen") || has("bathroom"), [214, 212, 204]),
    ];
    hints.into_iter().find(|(is_hit, _)| *is_hit).map(|(_, colour)| colour)
}
