"""The bundled catalogue's data: what the script makes of its sources, and surfaces against recorded objects."""

import filecmp
import gzip
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
SHARED = Path(os.environ.get("EVONAV_SHARED", ROOT.parent / "shared")) / "data"
DATA = ROOT / "rust" / "evonav-core" / "data"

pytestmark = pytest.mark.skipif(not SHARED.exists(), reason=f"{SHARED} is not there")


def rows(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in gzip.decompress(path.read_bytes()).splitlines()]


def test_the_script_reproduces_the_bundled_data(tmp_path: Path) -> None:
    script = ROOT / "scripts" / "build_asset_catalogue.py"
    subprocess.run([sys.executable, script, SHARED, "--out", tmp_path], check=True)
    names = sorted(path.name for path in DATA.glob("*.json") if path.name != "activities.json")  # made by hand
    assert names == ["assets.json", "categories.json", "groups.json", "materials.json"]
    assert filecmp.cmpfiles(DATA, tmp_path, names, shallow=False) == (names, [], [])


def test_recorded_cubes_rest_on_catalogue_surfaces() -> None:
    """Cubes that AI2-THOR put on receptacles; the catalogue was not derived from them."""
    folder = SHARED / "ram81-procthor-1k"
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
