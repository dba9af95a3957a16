"""Object records against those that AI2-THOR wrote itself."""

import gzip
import json
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from recorded_data import data_folder, data_path, needs_data
from thor_engine import Json, engine_in, records

from evonav.house import bundled_houses
from evonav.thor import edits, objects
from evonav.thor.asset_metadata import metadata_of_asset

ROOT = Path(__file__).parents[2]
RECORDED = data_path("ram81-procthor-1k")
needs_recorded = needs_data("ram81-procthor-1k", "ram81-procthor-100k-history", "procthor-databases")


@cache
def rows(path: Path) -> list[Json]:
    return [json.loads(line) for line in gzip.decompress(path.read_bytes()).splitlines()]


def recorded_cubes() -> list[Json]:
    episodes = rows(RECORDED / "procthor-attr-onav-locobot-val.jsonl.gz")
    return [record for episode in episodes for record in episode["targetObjectConfig"]["positions"].values()]


@needs_recorded
def test_records_have_the_fields_of_recorded_ones() -> None:
    house = json.loads(next(iter(bundled_houses(1))).to_json())
    scene = engine_in(house).scene
    fields = set(recorded_cubes()[0])
    assert all(set(record) == fields for record in objects.static_records(scene))


@needs_recorded
def test_the_script_reproduces_the_bundled_asset_metadata(tmp_path: Path) -> None:
    out = tmp_path / "assets.json"
    subprocess.run(
        [sys.executable, ROOT / "scripts" / "data" / "build_thor_assets.py", data_folder(), "--out", out], check=True
    )
    assert out.read_bytes() == (ROOT / "python" / "evonav" / "thor" / "data" / "assets.json").read_bytes()


@needs_recorded
def test_assets_agree_with_what_ai2thor_recorded_of_all_its_rooms() -> None:
    """8,715 records of iTHOR and RoboTHOR; positions follow from the boxes' middles, by the pivots, at any yaw."""
    packed = data_path("procthor-databases/ai2thor-object-metadata.json.gz").read_bytes()
    flags = agreed = pivots = 0
    off_m = []
    for record in records_in(json.loads(gzip.decompress(packed))):
        asset = metadata_of_asset(record["assetId"], record["objectType"])
        if not asset.size_m:
            continue
        ours = [flag in asset.flags for flag in objects.FLAGS]
        flags += len(ours)
        agreed += sum(a == record[flag] for a, flag in zip(ours, objects.FLAGS, strict=True))
        assert asset.mass_kg == pytest.approx(record["mass"], abs=1e-3)
        assert list(asset.materials or ()) == (record["salientMaterials"] or [])
        rotation = record["rotation"]
        if asset.pivot_m != (0.0, 0.0, 0.0) and abs((rotation["x"] + 180) % 360 - 180) < 0.5 > abs(
            (rotation["z"] + 180) % 360 - 180
        ):
            centre_m = list(record["axisAlignedBoundingBox"]["center"].values())
            pivot_m = np.add(centre_m, objects.rotation_of(rotation) @ asset.pivot_m)
            off_m.append(float(np.abs(pivot_m - list(record["position"].values())).max()))
            pivots += 1
    print(f"{agreed} of {flags} flags agree; pivots of {pivots} records: median {np.median(off_m):.5f} m")
    assert flags > 50_000
    assert agreed >= 0.99 * flags
    assert pivots > 3_000
    assert (np.quantile(off_m, [0.5, 0.9]) <= [1e-3, 1e-2]).all()


@needs_recorded
def test_oriented_boxes_are_those_that_ai2thor_recorded() -> None:
    """Of all that can be moved in iTHOR and RoboTHOR, from pivot, turn and asset alone; corner by corner."""
    packed = data_path("procthor-databases/ai2thor-object-metadata.json.gz").read_bytes()
    off_m = []
    for record in records_in(json.loads(gzip.decompress(packed))):
        asset, box = metadata_of_asset(record["assetId"], record["objectType"]), record["objectOrientedBoundingBox"]
        if box is None or asset.size_m is None or asset.pivot_m == (0.0, 0.0, 0.0) or record["isOpen"]:
            continue
        turn = objects.rotation_of(record["rotation"])
        x_m, y_m, z_m = np.subtract(list(record["position"].values()), turn @ asset.pivot_m).tolist()
        ours_m = objects.oriented_corners((x_m, y_m, z_m), asset.size_m, record["rotation"])
        off_m.append(float(np.abs(np.subtract(ours_m, box["cornerPoints"])).max()))
    quantiles_m = np.quantile(off_m, [0.5, 0.9, 0.98])
    print(f"corners of {len(off_m)} boxes: {quantiles_m.round(4)} m off at the 50th, 90th and 98th percentile")
    assert len(off_m) > 3_000
    assert (quantiles_m <= [0.001, 0.002, 0.02]).all()


def records_in(node: Any) -> list[Json]:
    if isinstance(node, dict) and "objectId" in node:
        return [node]
    children = node.values() if isinstance(node, dict) else node if isinstance(node, list) else ()
    return [record for child in children for record in records_in(child)]


def test_an_object_in_a_fridge_is_cold() -> None:
    house = json.loads(list(bundled_houses(3))[2].to_json())
    found = records(engine_in(house))
    fridge = next(record for record in found.values() if record["objectType"] == "Fridge")
    assert fridge["receptacleObjectIds"]
    cold = {object_id for object_id, record in found.items() if record["temperature"] == "Cold"}
    assert cold == set(fridge["receptacleObjectIds"])


@needs_recorded
def test_boxes_list_their_corners_as_recorded_ones() -> None:
    rotated = 0
    for record in recorded_cubes():
        box = record["axisAlignedBoundingBox"]
        ours = objects.aligned_box(list(box["center"].values()), list(box["size"].values()))
        np.testing.assert_allclose(ours["cornerPoints"], box["cornerPoints"], atol=1e-6)
        corners_m = record["objectOrientedBoundingBox"]["cornerPoints"]
        size_m = [float(np.linalg.norm(np.subtract(corners_m[0], corners_m[i]))) for i in (1, 4, 3)]
        centre_m = tuple(np.mean(corners_m, axis=0).tolist())
        ours_m = objects.oriented_corners(centre_m, (size_m[0], size_m[1], size_m[2]), record["rotation"])
        np.testing.assert_allclose(ours_m, corners_m, atol=2e-5)
        rotated += abs((record["rotation"]["y"] + 45) % 90 - 45) > 1
    assert rotated > 20


@needs_recorded
def test_objects_have_the_same_receptacles_as_recorded_cubes() -> None:
    """The receptacle under a thing, and `Floor` for all that begins lower than its trigger box ends."""
    houses = rows(RECORDED / "val.jsonl.gz")
    agreed = total = 0
    for index in sorted({episode["scene"] for episode in rows(RECORDED / "procthor-attr-onav-locobot-val.jsonl.gz")}):
        scene = engine_in(houses[index]).scene
        reach_m = houses[index]["proceduralParameters"]["receptacleHeight"]
        receptacles = [r for r in objects.static_records(scene) if r["receptacle"] and r["objectType"] != "Floor"]
        boxes = [r["axisAlignedBoundingBox"] for r in receptacles]
        centres_m, sizes_m = (np.array([list(box[key].values()) for box in boxes]) for key in ("center", "size"))
        for cube in cubes_of(index):
            parents = [parent.split("___")[0] for parent in cube["parentReceptacles"]]
            corners_m = np.array(cube["axisAlignedBoundingBox"]["cornerPoints"])
            bottom_m = corners_m[:, 1].min()
            assert ("Floor" in parents) == (bottom_m < reach_m)
            found = edits.find_receptacle(
                bottom_m, corners_m.mean(axis=0), centres_m - 0.5 * sizes_m, centres_m + 0.5 * sizes_m
            )
            agreed += found is not None and receptacles[found]["objectId"] == parents[0]
            total += 1
    assert total > 300
    print(f"receptacles agree for {agreed} of {total} cubes")
    assert agreed >= 0.99 * total


def cubes_of(index: int) -> list[Json]:
    episodes = rows(RECORDED / "procthor-attr-onav-locobot-val.jsonl.gz")
    return [
        cube
        for episode in episodes
        if episode["scene"] == index
        for cube in episode["targetObjectConfig"]["positions"].values()
    ]


@needs_recorded
def test_doors_and_windows_are_in_their_walls() -> None:
    """Position and turn follow from the wall; our body of a window, which has no leaf, has its middle there too."""
    num_windows = 0
    for house in rows(data_path("ram81-procthor-100k-history/uniform-hard-val-75.jsonl.gz"))[:3]:
        found = records(engine_in(house))
        for entry in house["windows"]:
            record, wall = found[entry["id"]], found[entry["wall0"]]
            middle_m = record["axisAlignedBoundingBox"]["center"]
            assert list(record["position"].values()) == pytest.approx(list(middle_m.values()), abs=0.06)
            assert (record["rotation"]["y"] - wall["rotation"]["y"]) % 360 == pytest.approx(180)
            num_windows += 1
        for entry in house["doors"]:
            assert found[entry["id"]]["objectType"] in ("Doorway", "Doorframe")
            assert found[entry["id"]]["openness"] == pytest.approx(
                entry["openness"] if found[entry["id"]]["openable"] else 0.0
            )
    assert num_windows > 5
