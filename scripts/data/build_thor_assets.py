"""Build the AI2-THOR engine's table of asset metadata, `python/evonav/thor/data/assets.json`.

    python scripts/data/build_thor_assets.py DATA [--out python/evonav/thor/data/assets.json]

DATA is a directory with `procthor-databases/`, the databases of the package `procthor` 0.0.1.dev2 (Allen Institute for
AI, Apache-2.0): the properties of 1,653 assets, and AI2-THOR's own records of all objects of iTHOR and RoboTHOR, from
which come masses, materials, first states, and where an asset's pivot is in its box.

The output is deterministic: same input, same bytes.
"""

from __future__ import annotations

import argparse
import gzip
import json
import math
import statistics
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, TypeAlias

Json: TypeAlias = dict[str, Any]

CREDIT = (
    "Derived by scripts/data/build_thor_assets.py from the databases of the package procthor 0.0.1.dev2 "
    "(Allen Institute for AI, Apache-2.0)."
)
# AI2-THOR's flag of a record, by the property that gives it. `CanBeUsedUp` gives none: `canBeUsedUp` is false in every
# record, of all 34 assets that have the property.
FLAGS = {
    "Receptacle": "receptacle",
    "CanOpen": "openable",
    "CanToggleOnOff": "toggleable",
    "CanBreak": "breakable",
    "CanBeFilled": "canFillWithLiquid",
    "CanBeDirty": "dirtyable",
    "CanBeCooked": "cookable",
    "CanBeSliced": "sliceable",
    "isHeatSource": "isHeatSource",
    "isColdSource": "isColdSource",
}
PRIMARY = {"CanPickup": "pickupable", "Moveable": "moveable"}
# Whose shelves are objects of their own in AI2-THOR, and receptacles; here they are one with their furniture.
SHELVED = "ShelvingUnit"
# States that some assets start with.
STATES = ("isOpen", "isToggled", "isFilledWithLiquid")
LEVEL_DEG = 0.5


def main() -> None:
    """Reads DATA, writes the table."""
    parser = argparse.ArgumentParser(description="Build evonav.thor's table of asset metadata.")
    parser.add_argument("data", type=Path, help="directory with procthor-databases/")
    parser.add_argument("--out", type=Path, default=Path("python/evonav/thor/data/assets.json"))
    arguments = parser.parse_args()
    databases = arguments.data / "procthor-databases"
    database = json.loads((databases / "asset-database.json").read_text(encoding="utf-8"))
    assets = sorted((a for group in database.values() for a in group), key=lambda asset: str(asset["assetId"]))
    with gzip.open(databases / "ai2thor-object-metadata.json.gz", "rt", encoding="utf-8") as file:
        rooms = json.load(file)
    by_asset: dict[str, list[Json]] = defaultdict(list)
    by_type: dict[str, list[Json]] = defaultdict(list)
    for record in records(rooms):
        by_asset[record["assetId"]].append(record)
        by_type[record["objectType"]].append(record)
    rows = [row(asset, by_asset.get(asset["assetId"], []), by_type.get(asset["objectType"], [])) for asset in assets]
    lines = ",\n".join(json.dumps(entry, separators=(",", ":")) for entry in rows)
    text = f'{{"credit":{json.dumps(CREDIT)},\n"assets":[\n{lines}\n]}}\n'
    arguments.out.write_text(text, encoding="utf-8")


def records(node: Any) -> Iterator[Json]:  # noqa: ANN401
    """All object records of a document."""
    if isinstance(node, dict) and "objectId" in node:
        yield node
    elif isinstance(node, (dict, list)):
        for child in node.values() if isinstance(node, dict) else node:
            yield from records(child)


def row(asset: Json, own: list[Json], alike: list[Json]) -> Json:
    """Facts of an asset, from its own records or else those of its type."""
    properties = {*asset.get("secondaryProperties", ()), asset.get("primaryProperty")}
    if asset["objectType"] == SHELVED:
        properties.add("Receptacle")
    flags = [flag for key, flag in {**PRIMARY, **FLAGS}.items() if key in properties]
    seen = own or alike
    entry: Json = {"id": asset["assetId"], "type": asset["objectType"], "flags": flags}
    states = [state for state in STATES if 2 * sum(bool(r[state]) for r in seen) > len(seen)]
    if states:
        entry["states"] = states
    materials = most_common(tuple(r["salientMaterials"]) for r in seen if r["salientMaterials"])
    if materials is not None:
        entry["materials"] = list(materials)
        entry["mass_kg"] = round(statistics.median(r["mass"] for r in seen if r["salientMaterials"]), 4)
    entry["size_m"] = [round(asset["boundingBox"][axis], 4) for axis in "xyz"]
    pivots_m = [pivot_m(record) for record in own if is_level(record)]
    if pivots_m:
        entry["pivot_m"] = [round(statistics.median(axis), 4) for axis in zip(*pivots_m, strict=True)]
    return entry


def most_common(values: Iterable[tuple[str, ...]]) -> tuple[str, ...] | None:
    """The value that comes most often; of equals the first by name."""
    counts = Counter(values)
    return min(counts, key=lambda value: (-counts[value], value)) if counts else None


def is_level(record: Json) -> bool:
    """Whether an object stands upright at a right angle to the room, so that its box is its own."""
    rotation = record["rotation"]
    is_upright = all(abs((rotation[axis] + 180) % 360 - 180) < LEVEL_DEG for axis in "xz")
    return is_upright and abs((rotation["y"] + 45) % 90 - 45) < LEVEL_DEG


def pivot_m(record: Json) -> tuple[float, float, float]:
    """The pivot seen from the middle of the box, in the asset's own frame."""
    centre = record["axisAlignedBoundingBox"]["center"]
    x, y, z = (record["position"][axis] - centre[axis] for axis in "xyz")
    yaw_rad = math.radians(record["rotation"]["y"])
    sine, cosine = math.sin(yaw_rad), math.cos(yaw_rad)
    return x * cosine - z * sine, y, x * sine + z * cosine


if __name__ == "__main__":
    main()
