"""What assets are made of: AI2-THOR's word where it has one, else by the names in ProcTHOR's material database."""

import json
from collections import Counter
from pathlib import Path

import pytest
from asset_materials import materials_named

ASSETS = Path(__file__).parents[2] / "rust" / "evonav-core" / "data" / "assets.json"


@pytest.mark.parametrize(
    ("group", "name", "word"),
    [
        ("SideTable", "RoboTHOR_Side_Table_Fornbro_Wood_Mat", "wood"),
        ("Wood", "BedroomFloor1", "wood"),
        ("Metal", "HammeredMetal_Dark", "metal"),
        ("Pan", "Pan_Primary1_Mat (Steel)", "metal"),
        ("Pot", "Pot_Primary2_Mat (Aluminum)", "metal"),
        ("Bowl", "Bowl_Mat3 (Glass)", "glass"),
        ("Cup", "Cup3_Mat (Ceramic)", "ceramic"),
        ("Fabric", "BlackFabirc", "fabric"),
        ("Sofa", "ArmChair1CusionsMatVar1", "fabric"),
        ("OfficeChair", "Brown_Leather_Mat", "leather"),
        ("Plastic", "BlueRubber", "plastic"),
        ("Box", "HaS_Cardboard_Mat1", "paper"),
        ("Wax", "Wax1", "wax"),
        ("Television", "BlackScreen", None),
        ("AlarmClock", "Alarm_Clock_Primary1_Mat", None),
    ],
)
def test_names_tell_the_material(group: str, name: str, word: str | None) -> None:
    assert materials_named([(group, name)]) == ([] if word is None else [word])


def test_the_first_two_materials_count_each_once() -> None:
    named = [("Wood", "DarkWood2"), ("Wood", "Cream_wood"), ("Metal", "BlackFoil"), ("Glass", "Glass1")]
    assert materials_named(named) == ["wood", "metal"]


def test_assets_have_the_materials_of_their_category() -> None:
    first = Counter(
        (row["category"], (row.get("made_of") or [None])[0]) for row in json.loads(ASSETS.read_text())["assets"]
    )
    assert first["Dresser", "wood"] > 20
    assert first["Dresser", "fabric"] == 0
    assert first["Sofa", "fabric"] > 30
    assert first["Toaster", "metal"] > 20
    assert first["Bowl", "ceramic"] > 5
    assert first["Bowl", "glass"] > 5
    num_unknown = sum(count for (_, word), count in first.items() if word is None)
    assert num_unknown < 0.15 * first.total()
