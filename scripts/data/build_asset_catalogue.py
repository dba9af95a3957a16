"""Builds the asset catalogue that ships with evonav: `rust/evonav-core/data/*.json`.

    python scripts/data/build_asset_catalogue.py DATA [--out rust/evonav-core/data]

DATA is a directory with

* `procthor-databases/`: the databases of the package `procthor` 0.0.1.dev2 (Allen Institute for AI, Apache-2.0):
  boxes, splits, properties and materials of 1,653 assets, what AI2-THOR says they are made of, placement annotations,
  receptacles, asset groups;
* `molmospaces-resources/material_to_textures.json` (allenai/molmospaces, Apache-2.0): albedo tint and texture name of
  1,245 materials. The textures themselves are not published with it, see `asset_materials.texture_mean`;
* any house files (`.json`, `.jsonl`, `.gz` of each) in which the simulator placed children on receptacles: the heights
  at which they rest become the assets' surface heights. Houses under `procthor-generated/` are left out: their
  children were placed with such heights in the first place.

The output is deterministic: same input, same bytes.
"""

from __future__ import annotations

import argparse
import gzip
import json
import math
import statistics
from collections import defaultdict
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, TypeAlias

from asset_materials import asset_colours, material_colour, materials_named, salient_materials, to_hex

Json: TypeAlias = dict[str, Any]

CREDIT = (
    "Derived by scripts/data/build_asset_catalogue.py from the databases of the package procthor 0.0.1.dev2 and from "
    "allenai/molmospaces (both Allen Institute for AI, Apache-2.0)."
)
PROPERTIES = {"CanPickup": "pickupable", "Moveable": "moveable", "Receptacle": "receptacle", "CanOpen": "openable"}
ROOMS = {"Kitchen": "inKitchens", "LivingRoom": "inLivingRooms", "Bedroom": "inBedrooms", "Bathroom": "inBathrooms"}
GROUP_ROOMS = {"Kitchen": "kitchens", "LivingRoom": "livingRooms", "Bedroom": "bedrooms", "Bathroom": "bathrooms"}
WHERE = {"corner": "inCorner", "middle": "inMiddle", "edge": "onEdge", "floor": "onFloor", "wall": "onWall"}


def main() -> None:
    """Reads DATA, writes `assets.json`, `categories.json`, `groups.json`, `materials.json` and `openings.json`."""
    parser = argparse.ArgumentParser(description="Build evonav's asset catalogue.")
    parser.add_argument("data", type=Path, help="directory with procthor-databases/ and house files")
    parser.add_argument("--out", type=Path, default=Path("rust/evonav-core/data"))
    arguments = parser.parse_args()
    databases = arguments.data / "procthor-databases"
    assets: list[Json] = [a for group in read(databases / "asset-database.json").values() for a in group]
    albedo = read(arguments.data / "molmospaces-resources" / "material_to_textures.json")
    materials = {name: material_colour(name, facts) for name, facts in sorted(albedo.items())}
    surfaces = surface_heights(assets, houses(arguments.data))
    salient = salient_materials(databases / "ai2thor-object-metadata.json.gz")
    annotations = read(databases / "placement-annotations.json")
    receptacles = read(databases / "receptacles.json")

    rows = sorted(assets, key=lambda asset: str(asset["assetId"]))
    colours = asset_colours(rows, materials)
    write(arguments.out / "assets.json", "assets", [asset_row(a, surfaces, colours, salient) for a in rows])
    names = sorted({str(a["objectType"]) for a in rows})
    write(arguments.out / "categories.json", "categories", [category_row(n, annotations, receptacles) for n in names])
    groups = [group_row(path.stem, read(path)) for path in sorted((databases / "asset_groups").glob("*.json"))]
    write(arguments.out / "groups.json", "groups", groups)
    write(arguments.out / "materials.json", "materials", [[name, to_hex(rgb)] for name, rgb in materials.items()])
    holes = read(databases / "wall-holes.json")
    openings = [asset for asset in rows if asset["objectType"] in ("Doorway", "Doorframe", "Window")]
    write(arguments.out / "openings.json", "openings", [opening_row(asset, holes) for asset in openings])


def read(path: Path) -> Any:  # noqa: ANN401
    """One JSON document."""
    return json.loads(path.read_text(encoding="utf-8"))


def write(path: Path, key: str, rows: Iterable[Any]) -> None:
    """One row a line: compact, and readable as a difference."""
    lines = ",\n".join(json.dumps(row, separators=(",", ":"), ensure_ascii=False) for row in rows)
    path.write_text(f'{{"credit":{json.dumps(CREDIT)},\n"{key}":[\n{lines}\n]}}\n', encoding="utf-8")


# --- surface heights -------------------------------------------------------------------------------------------------


def houses(data: Path) -> Iterator[Json]:
    """Every house under `data` that the real simulator filled."""
    for path in sorted(data.rglob("*.json*")):
        if "procthor-generated" in path.parts or "procthor-databases" in path.parts:
            continue
        text = gzip.decompress(path.read_bytes()).decode() if path.suffix == ".gz" else path.read_text("utf-8")
        is_lines = ".jsonl" in path.name
        documents = [json.loads(line) for line in text.splitlines() if line.strip()] if is_lines else [json.loads(text)]
        for document in documents:
            for house in document if isinstance(document, list) else [document]:
                if isinstance(house, dict) and "objects" in house and "rooms" in house:
                    yield house


def surface_heights(assets: Iterable[Json], recorded: Iterable[Json]) -> dict[str, list[float]]:
    """Heights above the box's bottom at which children rest, by asset id.

    Bottoms of children that the simulator dropped there (`small|...`) are clustered per asset; assets with few children
    take what their category shows, in parts of the asset's own height; receptacles of which nothing is known offer
    their top. Members of asset groups are not counted: the generator puts them on the box's top, so that pillows hang
    level with the bed's headboard.
    """
    by_id = {str(asset["assetId"]): asset for asset in assets}
    heights: dict[str, list[float]] = defaultdict(list)
    parts: dict[str, list[float]] = defaultdict(list)
    for house in recorded:
        for parent in house["objects"]:
            for child in parent.get("children", []):
                if not str(child["id"]).startswith("small|"):
                    continue
                if (asset := by_id.get(parent["assetId"])) and (held := by_id.get(child["assetId"])):
                    bottom = parent["position"]["y"] - size(asset)[1] / 2
                    height = child["position"]["y"] - turned_height(held, child["rotation"]) / 2 - bottom
                    # Lower or higher is a child that fell off, or stands on another child.
                    if 0.0 <= height <= size(asset)[1] + 0.03:
                        heights[parent["assetId"]].append(height)
                        parts[str(asset["objectType"])].append(height / size(asset)[1])
    surfaces = {}
    for name, asset in by_id.items():
        top = size(asset)[1]
        seen = without_hover(clusters(heights[name], gap=0.015, least=3, share=0.04))
        if not seen:
            category = clusters(parts[str(asset["objectType"])], gap=0.04, least=10, share=0.10)
            seen = without_hover([part * top for part in category])
        if not seen and "Receptacle" in asset.get("secondaryProperties", []):
            seen = [top]
        surfaces[name] = sorted({round(min(height, top), 3) for height in seen})
    return surfaces


def without_hover(rising: list[float]) -> list[float]:
    """Phones, laptops, vases and a few more rest exactly 5 cm above the surface that others rest on."""
    return [high for high in rising if not any(0.045 <= high - low <= 0.056 for low in rising)]


def size(asset: Json) -> tuple[float, float, float]:
    """Edge lengths x, y, z in metres."""
    box = asset["boundingBox"]
    return box["x"], box["y"], box["z"]


def turned_height(asset: Json, rotation: Json) -> float:
    """Height of the turned box (Unity Euler angles: about z, then x, then y)."""
    x, y, z = size(asset)
    pitch, roll = math.radians(rotation["x"]), math.radians(rotation["z"])
    in_x = abs(math.cos(pitch) * math.sin(roll)) * x
    in_y = abs(math.cos(pitch) * math.cos(roll)) * y
    return in_x + in_y + abs(math.sin(pitch)) * z


def clusters(values: list[float], *, gap: float, least: int, share: float) -> list[float]:
    """Medians of runs of values that are never `gap` apart, if `least` and a `share` of all values are in the run."""
    runs: list[list[float]] = []
    for value in sorted(values):
        if runs and value - runs[-1][-1] < gap:
            runs[-1].append(value)
        else:
            runs.append([value])
    return [statistics.median(run) for run in runs if len(run) >= max(least, share * len(values))]


# --- rows ------------------------------------------------------------------------------------------------------------


def asset_row(
    asset: Json, surfaces: dict[str, list[float]], colours: dict[str, list[str]], salient: dict[str, list[str]]
) -> Json:
    """Facts about one asset."""
    name = str(asset["assetId"])
    owned = [asset.get("primaryProperty"), *asset.get("secondaryProperties", [])]
    row: Json = {
        "id": name,
        "category": asset["objectType"],
        "size_m": [round(edge, 4) for edge in size(asset)],
        "split": asset["split"],
        "surfaces_m": surfaces[name],
        "colours": colours[name],
        "materials": [material for _, material in asset.get("materials") or []],
        "made_of": salient.get(name) or materials_named(asset.get("materials") or []),
    }
    row.update({flag: True for fact, flag in PROPERTIES.items() if fact in owned})
    return {key: value for key, value in row.items() if value not in (None, [])}


def category_row(category: str, annotations: dict[str, Json], receptacles: dict[str, Json]) -> Json:
    """Where a category is placed, and on what it was seen: share of that receptacle's instances that hold one."""
    row: Json = {"name": category}
    # The annotations are one table a fact, each from category to value.
    facts = {key: table.get(category) for key, table in annotations.items()}
    if facts["onFloor"] is not None or facts["onWall"] is not None:
        row["rooms"] = {room: facts[key] for room, key in ROOMS.items() if facts[key]}
        row["where"] = [place for place, key in WHERE.items() if facts[key]]
        row["is_kinematic"] = bool(facts["isKinematic"])
        row["is_structure"] = bool(facts["isStructure"])
        row["multiple_per_room"] = bool(facts["multiplePerRoom"])
    supports = {on: round(held[category]["p"], 4) for on, held in sorted(receptacles.items()) if category in held}
    if supports:
        row["supports"] = supports
    return row


def group_row(name: str, group: Json) -> Json:
    """An asset group: where it stands, and how each member is put to its parent; parents come first.

    In the frame of the first member, seen from above: x right, z forward. `anchor` is the side of the parent's box that
    a member is at (-1, 0, 1 along x and z), `align` the side of that line on which its own box lies, `offset_m` is
    added; `turn_deg` is its yaw, give or take `spread_deg`. ProcTHOR mirrors x when it reads its files, and so do we.
    Members of one `name` are the same asset, one of the `assets` that the first of them lists.
    """
    members: list[Json] = []

    def add(node: Json, parent: int | None) -> None:
        facts = group["assetMetadata"][str(node["instanceId"])]
        place = facts["position"]
        row: Json = {"category": next(iter(facts["assetIds"])), "spread_deg": facts["randomness"]["dtheta"]}
        row["name"] = facts["name"]
        if all(facts["name"] != member["name"] for member in members):
            row["assets"] = sorted(asset for assets in facts["assetIds"].values() for asset in assets)
        if parent is not None:
            anchor = int(place["relativeAnchorToParent"])
            row |= {
                "parent": parent,
                "is_above": place["verticalAlignment"] == "above",
                "anchor": [1 - anchor % 3, anchor // 3 - 1],
                "align": [place["xAlignment"] - 1, place["zAlignment"] - 1],
                "offset_m": [round(0.0 - place["x"], 4), round(place["z"], 4)],
                "turn_deg": facts["rotation"],
            }
        members.append(row)
        index = len(members) - 1
        for child in node.get("children", []):
            add(child, index)

    for node in group["treeData"]:
        add(node, None)
    properties = group["groupProperties"]
    location = properties["location"]
    return {
        "name": name,
        "rooms": {room: properties["roomWeights"][key] for room, key in GROUP_ROOMS.items()},
        "allows_duplicates": properties["properties"]["allowDuplicates"],
        "where": [place for place in ("corner", "middle", "edge") if location[place]],
        "members": members,
    }


def opening_row(asset: Json, holes: dict[str, Json]) -> Json:
    """The space that a door or window takes: `open_m`, the edges x and z of its box when open, and its hole in a wall.

    The hole begins at the wall's own origin of the asset, less `offset_m` along the wall and upwards. A door's hole is
    as large as its box, a window's is given. Doorframes share the offsets of the doors of the same number.
    """
    name = str(asset["assetId"])
    box = asset["boundingBox"]
    hole = holes[name.replace("Doorframe", "Doorway")]
    cut = hole["max"] if asset["objectType"] == "Window" else box
    is_open = asset.get("states", {}).get("open", {}).get("boundingBox", box)
    return {
        "id": name,
        "open_m": [round(is_open[axis], 4) for axis in ("x", "z")],
        "hole_m": [round(cut[axis], 4) for axis in ("x", "y")],
        "offset_m": [round(hole["offset"][axis] + 0.0, 4) for axis in ("x", "y")],
    }


if __name__ == "__main__":
    main()
