//! The materials that AI2-THOR's names stand for.

use crate::assets::material::{Material, MaterialKind};

/// Materials of floors and walls that have one colour in AI2-THOR, whatever their names say, and
/// the kind of their surface.
const PLAIN: [(&str, MaterialKind); 48] = {
    use MaterialKind::{Ceramic, Smooth};
    [
        ("Beams", Smooth),
        ("BlackWood", Ceramic),
        ("CeramicTiles1", Ceramic),
        ("CeramicTiles2", Ceramic),
        ("Ceramic_Shard_Mat", Smooth),
        ("ConcreteFloorSmooth 1", Smooth),
        ("Cream_wood", Smooth),
        ("DarkGranite", Ceramic),
        ("DarkGraniteDULL", Ceramic),
        ("Drywall", Smooth),
        ("DrywallBeige", Smooth),
        ("DrywallGreen", Smooth),
        ("DrywallOrange", Smooth),
        ("GreenCountertop", Ceramic),
        ("GreyCountertop", Ceramic),
        ("GreyFloor", Smooth),
        ("GreyFloor 1", Smooth),
        ("GreyFloor 2", Smooth),
        ("GreyFloor 3", Smooth),
        ("KitchenFloor", Ceramic),
        ("LightWhite", Ceramic),
        ("OrangeCabinet", Ceramic),
        ("OrangeCabinet 1", Ceramic),
        ("OrangeWood", Smooth),
        ("PVCLit", Smooth),
        ("Porcelain_Black_Mat", Ceramic),
        ("Porcelain_Blue_Mat", Ceramic),
        ("Porcelain_Grey_Mat", Ceramic),
        ("Porcelain_Off_White_Mat", Smooth),
        ("Porcelain_Red_Mat", Ceramic),
        ("Porcelain_Sand_Mat", Ceramic),
        ("Porcelain_Turquoise_Mat", Smooth),
        ("Porcelain_White_Mat", Ceramic),
        ("Porcelain_Yellow_Mat", Ceramic),
        ("PureBlack_Wood", Smooth),
        ("PureWhite", Smooth),
        ("RedBricks 1", Smooth),
        ("RedWall", Ceramic),
        ("RedWall 1", Smooth),
        ("TexturesCom_MarbleWhite0067_1_seamless_S", Ceramic),
        ("WallDrywallGrey", Smooth),
        ("WhiteWood1", Smooth),
        ("WhiteWoodClean", Smooth),
        ("Wicker", Smooth),
        ("Wood", Smooth),
        ("Wood 1", Smooth),
        ("White", Smooth),
        ("marbleBase3", Ceramic),
    ]
};

/// Parts of names in lower case, and the kind they stand for; the first match counts.
const PARTS_OF_NAMES: [(&[&str], MaterialKind); 31] = {
    use MaterialKind::{
        Bedding, Brick, Carpet, Ceramic, Checkerboard, Concrete, Fabric, Glass, Granite, Hexagons,
        Leather, Leaves, Marble, Metal, Mosaic, Painting, Paper, Parquet, Planks, Plaster, Shards,
        Slabs, Smooth, Soil, Subway, Tiles, Wicker, Wood,
    };
    [
        (&["drywall", "plaster"], Plaster),
        (&["carpet", "rug", "doormat", "brownpot"], Carpet),
        (&["bedsheet", "blanket", "fittedsheet", "mattress", "sheet"], Bedding),
        (&["leather"], Leather),
        (
            &[
                "fabric",
                "cloth",
                "couch",
                "sofa",
                "armchair",
                "chair_",
                "pillow",
                "towel",
                "curtain",
                "coat",
                "velvet",
                "upholster",
                "cushion",
                "shade",
                "teddybear",
                "ottoman",
                "fabirc",
                "satin",
                "doggybed",
            ],
            Fabric,
        ),
        (&["subway", "whitebrick"], Subway),
        (&["brick"], Brick),
        (&["hextiles"], Hexagons),
        (&["checkerboard"], Checkerboard),
        (&["irregular"], Shards),
        (&["marbletiles", "marble floor tiles", "granitetiles", "darktiles"], Slabs),
        (&["small", "kitchentiles", "kitchenwalls", "ceramictiles3"], Mosaic),
        (&["tile"], Tiles),
        (&["concrete"], Concrete),
        (&["marble", "whitegraniteclean"], Marble),
        (&["granite", "countertop"], Granite),
        (&["floorscross", "slashhatch"], Parquet),
        (&["plank", "floors", "wornwood", "bedroomfloor"], Planks),
        (&["wicker"], Wicker),
        (&["wood", "counters", "cabinet", "robinegg", "oak", "handle"], Wood),
        (
            &[
                "metal", "steel", "alumin", "chrome", "iron", "brass", "copper", "foil", "gold",
                "silver",
            ],
            Metal,
        ),
        (&["glass", "mirror", "window", "screen"], Glass),
        (&["leaves", "plant", "grass", "lettuce"], Leaves),
        (&["soil"], Soil),
        (&["paper", "cardboard", "label", "pages", "tissue", "poster"], Paper),
        (&["ceramic", "porcelain", "plate", "bowl", "sink", "toilet", "cup"], Ceramic),
        (&["painting", "photo", "_1280", "_1920", "landscape", "scene", "rockwell"], Painting),
        (&["van_gogh", "picture", "convergence"], Painting),
        (&["plastic", "rubber", "pvc", "trim", "paint", "soap", "wax"], Smooth),
        (&["primary", "secondary", "decal", "readout", "button", "light"], Smooth),
        (&["white", "black", "red", "green", "grey", "blue", "yellow", "orange"], Smooth),
    ]
};

impl Material {
    /// Return the material of one of AI2-THOR's names; a smooth one if the name says nothing.
    pub fn of_name(name: &str) -> Self {
        Self::named(kind_of_name(name).unwrap_or_default(), name)
    }
}

/// Return the kind of material that one of AI2-THOR's names stands for; `None` if it says nothing.
pub fn kind_of_name(name: &str) -> Option<MaterialKind> {
    if let Some(&(_, kind)) = PLAIN.iter().find(|(plain, _)| *plain == name) {
        return Some(kind);
    }
    let lower = name.to_ascii_lowercase();
    let matches = |parts: &[&str]| parts.iter().any(|part| lower.contains(part));
    PARTS_OF_NAMES.iter().find(|(parts, _)| matches(parts)).map(|&(_, kind)| kind)
}
