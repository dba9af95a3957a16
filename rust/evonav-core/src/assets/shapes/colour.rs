//! Colours and materials, and plausible ones where they are unknown.

use crate::assets::{Asset, material::MaterialKind};

/// A colour and what is painted with it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Paint {
    /// Colour, sRGB.
    pub colour: [u8; 3],
    /// Kind of the material.
    pub kind: MaterialKind,
}

impl Paint {
    const fn new(kind: MaterialKind, colour: [u8; 3]) -> Self {
        Self { colour, kind }
    }

    /// Return the paint as it looks: pale wood is painted, and its grain does not show.
    fn finished(self) -> Self {
        let is_painted = self.kind == MaterialKind::Wood && is_pale(self.colour);
        if is_painted { self.of(MaterialKind::Smooth) } else { self }
    }

    /// Return the same colour on another material.
    pub const fn of(self, kind: MaterialKind) -> Self {
        Self { kind, ..self }
    }
}

/// Return the paint of a smooth thing without a texture.
pub const fn rgb(red: u8, green: u8, blue: u8) -> Paint {
    Paint::new(MaterialKind::Smooth, [red, green, blue])
}

const fn wood(red: u8, green: u8, blue: u8) -> Paint {
    rgb(red, green, blue).of(MaterialKind::Wood)
}

const fn fabric(red: u8, green: u8, blue: u8) -> Paint {
    rgb(red, green, blue).of(MaterialKind::Fabric)
}

/// Kinds of wood, light to dark.
pub const WOODS: [Paint; 6] = [
    wood(205, 170, 125),
    wood(176, 132, 86),
    wood(150, 105, 70),
    wood(120, 78, 48),
    wood(92, 60, 40),
    wood(188, 140, 100),
];
/// Kinds of upholstery.
pub const FABRICS: [Paint; 6] = [
    fabric(130, 135, 145),
    fabric(95, 105, 125),
    fabric(165, 150, 130),
    fabric(120, 75, 65),
    fabric(100, 115, 100),
    fabric(190, 180, 165),
];
pub const STEEL: Paint = rgb(185, 188, 192).of(MaterialKind::Metal);
pub const DARK: Paint = rgb(45, 45, 48);
pub const CERAMIC: Paint = rgb(240, 240, 238).of(MaterialKind::Ceramic);

/// Return the colour number `index` of an asset, or `otherwise` where there is none. The material
/// is that of `otherwise`, unless the asset is made of something else.
pub fn tint(asset: &Asset, index: usize, otherwise: Paint) -> Paint {
    let colour = asset.colours.get(index).copied().unwrap_or(otherwise.colour);
    Paint { colour, kind: substance(asset, otherwise.kind) }.finished()
}

/// Return the kind of what is wood or cloth on most assets of a category.
fn substance(asset: &Asset, usual: MaterialKind) -> MaterialKind {
    let has = |name: &str| asset.made_of.iter().any(|substance| substance == name);
    match usual {
        MaterialKind::Wood if has("wood") || asset.made_of.is_empty() => usual,
        MaterialKind::Wood if has("metal") => MaterialKind::Metal,
        MaterialKind::Wood if has("plastic") => MaterialKind::Smooth,
        MaterialKind::Fabric if has("leather") => MaterialKind::Leather,
        _ => usual,
    }
}

/// Make a colour darker (`factor` below 1) or lighter.
pub fn shade(paint: Paint, factor: f64) -> Paint {
    let scaled = |channel| (f64::from(channel) * factor).round().clamp(0.0, 255.0) as u8;
    Paint { colour: paint.colour.map(scaled), ..paint }
}

/// Return whether wood of a colour is painted white rather than shows its grain.
pub fn is_pale(colour: [u8; 3]) -> bool {
    colour.iter().all(|&channel| channel > 175)
}

/// Return the colour that a material shows indoors: black reflects a little and white not all.
pub fn lit(colour: [u8; 3]) -> [u8; 3] {
    colour.map(|channel| 24 + (f64::from(channel) * 0.9).round() as u8)
}

/// Return the lightest of an asset's colours: its shade, screen or cloth; `otherwise` if none is
/// light.
pub fn lightest(asset: &Asset, otherwise: Paint) -> Paint {
    let sum = |colour: &&[u8; 3]| colour.iter().map(|&c| u32::from(c)).sum::<u32>();
    let lightest = asset.colours.iter().max_by_key(sum).filter(|c| sum(c) > 450);
    Paint { colour: lightest.copied().unwrap_or(otherwise.colour), ..otherwise }
}

/// Return the most colourful of an asset's colours after the first; `otherwise` if all are dull.
pub fn liveliest(asset: &Asset, otherwise: Paint) -> Paint {
    let spread = |c: &&[u8; 3]| c.iter().max().zip(c.iter().min()).map_or(0, |(a, b)| a - b);
    let rest = asset.colours.iter().skip(1);
    let liveliest = rest.max_by_key(spread).filter(|c| spread(c) > 60);
    Paint { colour: liveliest.copied().unwrap_or(otherwise.colour), ..otherwise }
}
