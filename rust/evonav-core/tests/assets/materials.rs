//! Names of materials, and the kinds that they stand for.

use crate::common::recorded::data_set;
use evonav_core::assets::{
    kind_of_name,
    material::{Material, MaterialKind},
};
use serde_json::Value;

#[test]
fn names_of_floors_and_walls_stand_for_what_they_say() {
    use MaterialKind as Kind;
    for (name, kind) in [
        ("WoodFloorsCross", Kind::Parquet),
        ("DarkWoodPlanks", Kind::Planks),
        ("TexturesCom_WoodFine0044_1_seamless_S", Kind::Wood),
        ("OrangeCabinet", Kind::Ceramic),
        ("GreyFloor 2", Kind::Smooth),
        ("Carpet8TILED", Kind::Carpet),
        ("YellowDrywallTiled3", Kind::Plaster),
        ("BrownMarbleFake 1", Kind::Marble),
        ("WhileMarbleTiles", Kind::Slabs),
        ("bathroomTilesGrey 2", Kind::Tiles),
        ("SmallTiles 1", Kind::Mosaic),
        ("SubwayTilesRough 1", Kind::Subway),
        ("HexTiles", Kind::Hexagons),
        ("KitchenTilesCheckerboard", Kind::Checkerboard),
        ("BrickSmallNew0073_4_S", Kind::Brick),
        ("RedBricks 1", Kind::Smooth),
        ("ConcreteBoards1", Kind::Concrete),
        ("PureWhite", Kind::Smooth),
    ] {
        assert_eq!(kind_of_name(name), Some(kind), "{name}");
    }
    assert_eq!(kind_of_name("zzz"), None);
    assert_eq!(Material::of_name("zzz").kind, MaterialKind::Smooth);
}

#[test]
fn every_material_of_floors_and_walls_is_known() {
    let Some(folder) = data_set("procthor-databases") else { return };
    let text = std::fs::read_to_string(folder.join("material-database.json")).expect("readable");
    let database: Value = serde_json::from_str(&text).expect("valid JSON");
    for list in ["Wall", "Wood", "Fabric"] {
        for name in database[list].as_array().expect("a list") {
            let name = name.as_str().expect("a name");
            assert!(kind_of_name(name).is_some(), "{list} {name:?}");
        }
    }
}
