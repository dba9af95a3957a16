//! Draw the textures of materials, from noise and arithmetic alone.
//!
//! A texture is drawn when it is first needed, once a process, and is the same on every platform.

mod building;
mod cloth;
mod fittings;
mod noise;
mod pictures;
mod texture;

use std::sync::OnceLock;

pub use texture::{Level, MOST_PLACES, NEUTRAL, Sums, Texel, Texture};

use crate::assets::material::{Layout, Material, MaterialKind};

/// Largest number of textures of a kind.
const MAX_VARIANTS: usize = 32;

static TEXTURES: [[OnceLock<Texture>; MAX_VARIANTS]; MaterialKind::ALL.len()] =
    [const { [const { OnceLock::new() }; MAX_VARIANTS] }; MaterialKind::ALL.len()];

/// Return the texture of a material; `None` for materials without one.
pub fn texture_of(material: Material) -> Option<&'static Texture> {
    let kind = material.kind.drawn_as();
    let (variant, count) = (usize::from(material.variant), kind.num_variants());
    // A division takes longer than the rest, and names of materials choose small numbers.
    let variant = if variant < count { variant } else { variant % count };
    let slot = &TEXTURES[kind as usize][variant];
    slot.get().or_else(|| drawn(slot, kind, variant))
}

#[cold]
fn drawn(
    slot: &'static OnceLock<Texture>,
    kind: MaterialKind,
    variant: usize,
) -> Option<&'static Texture> {
    let has_texture = kind.layout() != Layout::Plain;
    has_texture.then(|| slot.get_or_init(|| draw(kind, variant as u32)))
}

/// A function that gives a texture's colours at `[u, v]`, for a seed.
type Pattern = fn(f32, f32, u32) -> Texel;

/// Draw one of the textures of a kind.
fn draw(kind: MaterialKind, variant: u32) -> Texture {
    use MaterialKind as Kind;
    let flat: Pattern = |_, _, _| [1.0; 4];
    let (log2_size, pattern): (u32, Pattern) = match kind {
        Kind::Smooth | Kind::Ceramic | Kind::Glass | Kind::Pane => (0, flat),
        Kind::Plaster => (7, building::plaster),
        Kind::Planks => (8, building::planks),
        Kind::Parquet => (8, building::parquet),
        Kind::Wood => (7, building::wood),
        Kind::Slabs => (7, building::slabs),
        Kind::Tiles => (7, building::tiles),
        Kind::Mosaic => (7, building::mosaic),
        Kind::Subway => (7, building::subway),
        Kind::Hexagons => (7, building::hexagons),
        Kind::Checkerboard => (7, building::checkerboard),
        Kind::Shards => (7, building::shards),
        Kind::Brick => (7, building::brick),
        Kind::Concrete => (7, building::concrete),
        Kind::Marble => (7, building::marble),
        Kind::Granite => (6, building::granite),
        Kind::Carpet => (7, cloth::carpet),
        Kind::Fabric => (6, cloth::fabric),
        Kind::Bedding => (7, cloth::bedding),
        Kind::Leather => (6, cloth::leather),
        Kind::Metal => (6, cloth::metal),
        Kind::Paper => (5, cloth::paper),
        Kind::Leaves => (7, cloth::leaves),
        Kind::Soil => (6, cloth::soil),
        Kind::Wicker => (6, cloth::wicker),
        Kind::Cushion => (7, cloth::cushion),
        Kind::Pillow => (6, cloth::pillow),
        Kind::Duvet => (7, cloth::duvet),
        Kind::Rug => (7, cloth::rug),
        Kind::Panel => (7, fittings::panel),
        Kind::Drawer => (7, fittings::drawer),
        Kind::Appliance => (7, fittings::appliance),
        Kind::OvenDoor => (7, fittings::oven_door),
        Kind::Hob => (7, fittings::hob),
        Kind::Painting | Kind::PaintingTop | Kind::PaintingBottom => (7, pictures::painting),
        Kind::DarkScreen => (6, fittings::dark_screen),
        Kind::LitScreen => (7, fittings::lit_screen),
        Kind::Keyboard => (7, fittings::keyboard),
        Kind::Cover => (6, fittings::cover),
        Kind::Pages => (6, fittings::pages),
        Kind::Print => (7, fittings::print),
        Kind::Outdoors => (7, pictures::outdoors),
        Kind::ClockFace => (6, fittings::clock_face),
    };
    Texture::draw(log2_size, kind.is_picture(), |u, v| pattern(u, v, variant))
}
