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

pub use texture::{Level, MOST_PLACES, NEUTRAL, Pattern, Sums, Texel, Texture};

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

/// Draw one of the textures of a kind.
fn draw(kind: MaterialKind, variant: u32) -> Texture {
    use MaterialKind as Kind;
    /// Draws a texture with a size and a pattern.
    macro_rules! drawn {
        ($log2_size:literal, $pattern:path) => {{
            struct Drawn(u32);
            impl Pattern for Drawn {
                #[inline(always)]
                fn at(&self, u: f32, v: f32) -> Texel {
                    $pattern(u, v, self.0)
                }
            }
            Texture::draw($log2_size, kind.is_picture(), &Drawn(variant))
        }};
    }
    match kind {
        Kind::Smooth | Kind::Ceramic | Kind::Glass | Kind::Pane => drawn!(0, flat),
        Kind::Plaster => drawn!(7, building::plaster),
        Kind::Planks => drawn!(8, building::planks),
        Kind::Parquet => drawn!(8, building::parquet),
        Kind::Wood => drawn!(7, building::wood),
        Kind::Slabs => drawn!(7, building::slabs),
        Kind::Tiles => drawn!(7, building::tiles),
        Kind::Mosaic => drawn!(7, building::mosaic),
        Kind::Subway => drawn!(7, building::subway),
        Kind::Hexagons => drawn!(7, building::hexagons),
        Kind::Checkerboard => drawn!(7, building::checkerboard),
        Kind::Shards => drawn!(7, building::shards),
        Kind::Brick => drawn!(7, building::brick),
        Kind::Concrete => drawn!(7, building::concrete),
        Kind::Marble => drawn!(7, building::marble),
        Kind::Granite => drawn!(6, building::granite),
        Kind::Carpet => drawn!(7, cloth::carpet),
        Kind::Fabric => drawn!(6, cloth::fabric),
        Kind::Bedding => drawn!(7, cloth::bedding),
        Kind::Leather => drawn!(6, cloth::leather),
        Kind::Metal => drawn!(6, cloth::metal),
        Kind::Paper => drawn!(5, cloth::paper),
        Kind::Leaves => drawn!(7, cloth::leaves),
        Kind::Soil => drawn!(6, cloth::soil),
        Kind::Wicker => drawn!(6, cloth::wicker),
        Kind::Cushion => drawn!(7, cloth::cushion),
        Kind::Pillow => drawn!(6, cloth::pillow),
        Kind::Duvet => drawn!(7, cloth::duvet),
        Kind::Rug => drawn!(7, cloth::rug),
        Kind::Panel => drawn!(7, fittings::panel),
        Kind::Drawer => drawn!(7, fittings::drawer),
        Kind::Appliance => drawn!(7, fittings::appliance),
        Kind::OvenDoor => drawn!(7, fittings::oven_door),
        Kind::Hob => drawn!(7, fittings::hob),
        Kind::Painting | Kind::PaintingTop | Kind::PaintingBottom => drawn!(7, pictures::painting),
        Kind::DarkScreen => drawn!(6, fittings::dark_screen),
        Kind::LitScreen => drawn!(7, fittings::lit_screen),
        Kind::Keyboard => drawn!(7, fittings::keyboard),
        Kind::Cover => drawn!(6, fittings::cover),
        Kind::Pages => drawn!(6, fittings::pages),
        Kind::Print => drawn!(7, fittings::print),
        Kind::Outdoors => drawn!(7, pictures::outdoors),
        Kind::ClockFace => drawn!(6, fittings::clock_face),
    }
}

/// Return the texel of surfaces without a texture.
fn flat(_: f32, _: f32, _: u32) -> Texel {
    [1.0; 4]
}
