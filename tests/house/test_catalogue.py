"""The bundled catalogue's data: what the script makes of its sources, and surfaces against recorded objects."""

import filecmp
import gzip
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

from recorded_data import data_folder, data_path, needs_data

ROOT = Path(__file__).parents[2]
DATA = ROOT / "rust" / "evonav-core" / "data"
BY_HAND = ("activities.json", "surfaces.json")
HOUSE_SETS = (
    "michael-quinlan-hallway-houses",
    "ram81-procthor-100k-history",
    "ram81-procthor-1k",
    "ram81-procthor-one-room",
    "roseh-procthor-100k-history",
    "zhiyuan-gao-procthor-houses",
)
"""Houses that AI2-THOR furnished: surfaces are learnt from them."""


def rows(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in gzip.decompress(path.read_bytes()).splitlines()]


@needs_data("procthor-databases", "molmospaces-resources", *HOUSE_SETS)
def test_the_script_reproduces_the_bundled_data(tmp_path: Path) -> None:
    script = ROOT / "scripts" / "data" / "build_asset_catalogue.py"
    subprocess.run([sys.executable, script, data_folder(), "--out", tmp_path], check=True)
    names = sorted(path.name for path in DATA.glob("*.json") if path.name not in BY_HAND)
    assert names == ["assets.json", "categories.json", "groups.json", "materials.json", "openings.json"]
    assert filecmp.cmpfiles(DATA, tmp_path, names, shallow=False) == (names, [], [])


@needs_data("ram81-procthor-1k")
def test_recorded_cubes_rest_on_catalogue_surfaces() -> None:
    """Cubes that AI2-THOR put on receptacles; the catalogue was not derived from them."""
    folder = data_path("ram81-procthor-1k")
    houses = rows(folder / "val.jsonl.gz")
    assets = {asset["id"]: asset for asset in json.loads((DATA / "assets.json").read_text())["assets"]}
    offsets_m = []
    for episode in rows(folder / "procthor-attr-onav-locobot-val.jsonl.gz"):
        objects = {entry["id"]: entry for entry in houses[int(episode["scene"])]["objects"]}
        for cube in episode["targetObjectConfig"]["positions"].values():
            box = cube["axisAlignedBoundingBox"]
            bottom_m = box["center"]["y"] - box["size"]["y"] / 2
            for parent in (objects[key] for key in cube["parentReceptacles"] or [] if key in objects):
                asset = assets[parent["assetId"]]
                height_m = bottom_m - (parent["position"]["y"] - asset["size_m"][1] / 2)
                offsets_m.append(min(abs(height_m - surface_m) for surface_m in asset["surfaces_m"]))
    near = sum(offset_m < 0.03 for offset_m in offsets_m)
    assert len(offsets_m) > 800
    assert near / len(offsets_m) > 0.97
