//! Materials of surfaces, as far as they can be seen.

/// A material: its kind, and which of the kind's textures it has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Material {
    /// Kind, which decides texture, scale and gloss.
    pub kind: MaterialKind,
    /// Any number; equal numbers look the same, others may.
    pub variant: u8,
}

impl Material {
    /// Return the material of a kind whose variant is chosen by the checksum of a name.
    pub fn named(kind: MaterialKind, name: &str) -> Self {
        let sum = hash_of_name(name);
        Self { kind, variant: ((sum ^ sum >> 16) as usize % kind.num_variants()) as u8 }
    }
}

/// Hash a name by FNV-1a, so that an asset's choices do not change between runs or platforms.
pub fn hash_of_name(name: &str) -> u32 {
    name.bytes().fold(0x811c_9dc5, |h, byte| (h ^ u32::from(byte)).wrapping_mul(0x0100_0193))
}

/// The look of a surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Finish {
    /// Colour, sRGB.
    pub colour: [u8; 3],
    /// Material.
    pub material: Material,
}

/// The way in which a texture lies on a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Layout {
    /// The surface has no texture.
    Plain,
    /// The texture repeats every `[along, across]` metres.
    Repeated([f64; 2]),
    /// The texture fills each of the two broadest faces of a part once; the others are plain.
    Broad,
    /// The part of the texture between two heights, from 0 (its upper edge) to 1, fills each of the
    /// two broadest faces; the others are plain.
    Strip([f64; 2]),
    /// The texture fills every face once.
    Every,
}

macro_rules! kinds {
    ($($(#[$doc:meta])* $name:ident: $layout:expr, gloss $gloss:literal, variants $variants:literal;)+) => {
        /// Kinds of materials and of pictures on surfaces.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
        #[repr(u8)]
        pub enum MaterialKind {
            #[default]
            $($(#[$doc])* $name,)+
        }

        impl MaterialKind {
            /// All kinds.
            pub const ALL: &'static [Self] = &[$(Self::$name),+];

            /// Return how the kind's textures lie on surfaces.
            pub const fn layout(self) -> Layout {
                match self { $(Self::$name => $layout,)+ }
            }

            /// Return how strongly surfaces of the kind shine, from 0 (matt) to 1 (a mirror).
            pub const fn gloss(self) -> f32 {
                match self { $(Self::$name => $gloss,)+ }
            }

            /// Return the number of different textures of the kind.
            pub const fn num_variants(self) -> usize {
                match self { $(Self::$name => $variants,)+ }
            }
        }
    };
}

use Layout::{Broad, Every, Plain, Repeated, Strip};

kinds! {
    /// Paint, plastic and all that has no visible texture.
    Smooth: Plain, gloss 0.15, variants 1;
    /// Polished things: porcelain, enamel, varnish.
    Ceramic: Plain, gloss 0.6, variants 1;
    /// Glass of bottles and other small things.
    Glass: Plain, gloss 0.9, variants 1;
    /// Glass that is seen through.
    Pane: Plain, gloss 0.9, variants 1;
    /// Painted plaster.
    Plaster: Repeated([1.6, 1.6]), gloss 0.05, variants 2;
    /// Floorboards.
    Planks: Repeated([2.4, 1.2]), gloss 0.35, variants 3;
    /// Short boards laid across each other.
    Parquet: Repeated([0.96, 0.96]), gloss 0.4, variants 2;
    /// Wood with its grain, as on furniture.
    Wood: Repeated([1.2, 0.6]), gloss 0.25, variants 3;
    /// Stone slabs of 40 cm.
    Slabs: Repeated([1.6, 1.6]), gloss 0.6, variants 2;
    /// Tiles of 20 cm.
    Tiles: Repeated([0.8, 0.8]), gloss 0.5, variants 2;
    /// Tiles of 5 cm.
    Mosaic: Repeated([0.4, 0.4]), gloss 0.5, variants 2;
    /// Flat tiles laid as bricks are.
    Subway: Repeated([0.6, 0.6]), gloss 0.5, variants 2;
    /// Six-sided tiles.
    Hexagons: Repeated([0.48, 0.415_692]), gloss 0.5, variants 1;
    /// Light and dark tiles in turn.
    Checkerboard: Repeated([0.8, 0.8]), gloss 0.4, variants 1;
    /// Pieces of tiles of any shape.
    Shards: Repeated([0.6, 0.6]), gloss 0.6, variants 1;
    /// Bricks with mortar.
    Brick: Repeated([0.96, 0.6]), gloss 0.05, variants 2;
    /// Concrete.
    Concrete: Repeated([2.0, 2.0]), gloss 0.2, variants 2;
    /// Marble with veins.
    Marble: Repeated([1.2, 1.2]), gloss 0.6, variants 3;
    /// Stone of fine grains, as on worktops.
    Granite: Repeated([0.4, 0.4]), gloss 0.5, variants 2;
    /// Carpet.
    Carpet: Repeated([0.5, 0.5]), gloss 0.0, variants 2;
    /// Woven cloth.
    Fabric: Repeated([0.25, 0.25]), gloss 0.0, variants 3;
    /// Cloth with a printed pattern, as on beds.
    Bedding: Repeated([0.8, 0.8]), gloss 0.0, variants 6;
    /// Leather.
    Leather: Repeated([0.35, 0.35]), gloss 0.35, variants 2;
    /// Brushed metal.
    Metal: Repeated([0.5, 0.25]), gloss 0.6, variants 2;
    /// Paper and cardboard.
    Paper: Repeated([0.3, 0.3]), gloss 0.05, variants 2;
    /// Leaves.
    Leaves: Repeated([0.3, 0.3]), gloss 0.2, variants 3;
    /// Soil.
    Soil: Repeated([0.2, 0.2]), gloss 0.0, variants 1;
    /// Woven canes.
    Wicker: Repeated([0.24, 0.24]), gloss 0.1, variants 1;
    /// A cushion with a seam around each face.
    Cushion: Every, gloss 0.0, variants 3;
    /// A pillow: white linen with folds.
    Pillow: Broad, gloss 0.0, variants 3;
    /// A duvet with folds, its upper edge turned back.
    Duvet: Broad, gloss 0.0, variants 6;
    /// A rug with a border.
    Rug: Broad, gloss 0.0, variants 4;
    /// A wooden panel, raised in its middle.
    Panel: Broad, gloss 0.3, variants 2;
    /// A drawer's front, with a shadow around it.
    Drawer: Broad, gloss 0.3, variants 2;
    /// A metal door with a soft vertical sheen.
    Appliance: Broad, gloss 0.6, variants 2;
    /// A dark window with an oven's light behind it.
    OvenDoor: Broad, gloss 0.7, variants 1;
    /// A hob with four rings.
    Hob: Broad, gloss 0.7, variants 2;
    /// A painting or a photograph.
    Painting: Broad, gloss 0.1, variants 32;
    /// The upper three fifths of a painting.
    PaintingTop: Strip([0.0, 0.6]), gloss 0.1, variants 32;
    /// The lower two fifths of a painting.
    PaintingBottom: Strip([0.6, 1.0]), gloss 0.1, variants 32;
    /// A screen that is off.
    DarkScreen: Broad, gloss 0.8, variants 2;
    /// A screen that is on.
    LitScreen: Broad, gloss 0.3, variants 8;
    /// A keyboard.
    Keyboard: Broad, gloss 0.1, variants 1;
    /// The cover of a book.
    Cover: Broad, gloss 0.3, variants 16;
    /// The edges of pages.
    Pages: Every, gloss 0.0, variants 1;
    /// A printed page.
    Print: Broad, gloss 0.0, variants 4;
    /// The world outside a window.
    Outdoors: Broad, gloss 0.2, variants 6;
    /// A clock's face.
    ClockFace: Broad, gloss 0.3, variants 2;
}

impl MaterialKind {
    /// Return whether the texture holds colours of its own, in place of the surface's.
    pub const fn is_picture(self) -> bool {
        matches!(
            self,
            Self::Painting
                | Self::PaintingTop
                | Self::PaintingBottom
                | Self::DarkScreen
                | Self::LitScreen
                | Self::Keyboard
                | Self::Outdoors
                | Self::Print
                | Self::ClockFace
                | Self::OvenDoor
                | Self::Hob
        )
    }

    /// Return the kind whose textures this kind shows.
    pub const fn drawn_as(self) -> Self {
        match self {
            Self::PaintingTop | Self::PaintingBottom => Self::Painting,
            _ => self,
        }
    }

    /// Return whether the surface shines by itself.
    pub const fn glows(self) -> bool {
        matches!(self, Self::LitScreen | Self::Outdoors)
    }
}
