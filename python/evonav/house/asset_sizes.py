"""Read the sizes of assets that the catalogue lacks, and write them into the houses that use them.

A house keeps what it is given under `metadata.evonav_assets`, so tasks, workers and viewers need no second file.
"""

import gzip
import json
import re
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from evonav import _core
from evonav.errors import HouseError

FLAGS = ("pickupable", "moveable", "receptacle", "openable")
KEYS = ("size_m", "category", *FLAGS)
"""Keys of an entry of evonav's own format."""
MIN_EDGE_M, MAX_EDGE_M = 0.001, 30.0
KEY = "evonav_assets"
"""Key of a house's `metadata` that holds the sizes."""


@dataclass(frozen=True, slots=True)
class AssetSizes:
    """Sizes, categories and flags of assets by id, from one file."""

    path: Path
    entries: Mapping[str, Mapping[str, Any]] = field(repr=False)
    """Entries as houses hold them: `size_m`, `category` and the flags that are true."""

    def embed(self, document: dict[str, Any]) -> bool:
        """Write the entries of all assets that a house uses and the catalogue lacks into its metadata; true if any."""
        used = sorted({str(item.get("assetId")) for item in each_object(document)} & self.entries.keys())
        found = {asset_id: dict(self.entries[asset_id]) for asset_id in used if asset_id not in catalogue_ids()}
        if found:
            document["metadata"] = {**document.get("metadata", {}), KEY: found}
        return bool(found)


@cache
def catalogue_ids() -> frozenset[str]:
    """Return the ids of the assets of the catalogue."""
    return frozenset(asset_id for asset_id, _, _ in _core.assets())


def each_object(document: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    """Yield the objects of a house document, each before the objects on it."""
    waiting = [*reversed(document.get("objects") or ())]
    while waiting:
        item = waiting.pop()
        if isinstance(item, dict):
            yield item
            waiting += reversed(item.get("children") or ())


def read_asset_sizes(path: Path | str) -> AssetSizes:
    """Read a file of asset sizes: JSON, also with `.gz`, an entry for each asset id.

    An entry is evonav's own (`size_m`, `category`, flags) or an annotation of Objaverse assets as objathor and
    Holodeck publish them, whose box `thor_metadata.assetMetadata.boundingBox` is used. Annotations without a box are
    left out.

    Raises:
        HouseError: The file cannot be read or an entry is wrong; names file, id, field and value.
    """
    path = Path(path)
    try:
        text = gzip.decompress(path.read_bytes()) if path.suffix == ".gz" else path.read_bytes()
        entries = json.loads(text)
    except (OSError, EOFError, ValueError, RecursionError, zlib.error) as error:
        raise HouseError(f"{path}: cannot be read: {error}") from error
    if not isinstance(entries, dict):
        raise HouseError(f"{path}: is a {type(entries).__name__}, expected an object with an entry for each asset id")
    read = ((asset_id, _entry(_Place(path, asset_id), entry)) for asset_id, entry in entries.items())
    return AssetSizes(path, {asset_id: entry for asset_id, entry in read if entry is not None})


@dataclass(frozen=True, slots=True)
class _Place:
    """The place of an entry, for errors."""

    path: Path
    asset_id: str

    def error(self, name: str, value: object, expected: str) -> HouseError:
        shown = json.dumps(value)
        shown = shown if len(shown) <= 80 else f"{shown[:77]}..."
        return HouseError(f"{self.path}: asset {self.asset_id}: field `{name}` is {shown}, expected {expected}")


def _entry(place: _Place, entry: Any) -> dict[str, Any] | None:  # noqa: ANN401 - JSON
    if not isinstance(entry, dict):
        raise place.error("(whole)", entry, "an object")
    if not entry.keys() & {"annotations", "thor_metadata", "assetMetadata", "onFloor", "uid"}:
        return _own_entry(place, entry)
    return _annotation(place, entry)


def _own_entry(place: _Place, entry: dict[str, Any]) -> dict[str, Any]:
    """Check an entry of evonav's own format."""
    unknown = next((key for key in entry if key not in KEYS), None)
    if unknown is not None:
        raise place.error(unknown, entry[unknown], f"one of the fields {', '.join(KEYS)}")
    for key in ("size_m", "category"):
        if key not in entry:
            raise HouseError(f"{place.path}: asset {place.asset_id}: field `{key}` is missing")
    size = entry["size_m"]
    if not isinstance(size, list) or len(size) != 3:
        raise place.error("size_m", size, "three edge lengths, [x, y, z]")
    flags = {key: entry[key] for key in FLAGS if key in entry}
    wrong = next((key for key, value in flags.items() if not isinstance(value, bool)), None)
    if wrong is not None:
        raise place.error(wrong, flags[wrong], "true or false")
    edges = [_edge(place, f"size_m[{i}]", edge) for i, edge in enumerate(size)]
    true = {key: True for key, value in flags.items() if value}
    return {"size_m": edges, "category": _category(place, entry["category"]), **true}


def _annotation(place: _Place, entry: dict[str, Any]) -> dict[str, Any] | None:
    """Read an annotation of an Objaverse asset; `None` if it has no box."""
    labels = entry.get("annotations", entry)
    metadata = entry.get("assetMetadata") or (entry.get("thor_metadata") or {}).get("assetMetadata") or {}
    box = metadata.get("boundingBox")
    if box is None:
        return None
    size = _box_size(place, box)
    primary, secondary = metadata.get("primaryProperty"), metadata.get("secondaryProperties") or ()
    flags = {
        "pickupable": primary == "CanPickup",
        "moveable": primary == "Moveable",
        "receptacle": labels.get("receptacle") is True or "Receptacle" in secondary,
        "openable": "CanOpen" in secondary,
    }
    true = {key: True for key, value in flags.items() if value}
    return {"size_m": size, "category": _category(place, labels.get("category")), **true}


def _box_size(place: _Place, box: Any) -> list[float]:  # noqa: ANN401 - JSON
    """Return the edges of a box `{x, y, z}`, `{"size": {x, y, z}}` or `{"min", "max"}`."""
    name = "boundingBox"
    try:
        edges = box.get("size", box)
        if "min" in box and "max" in box:
            edges = {axis: box["max"][axis] - box["min"][axis] for axis in "xyz"}
        return [_edge(place, f"{name}.{axis}", edges[axis]) for axis in "xyz"]
    except (AttributeError, KeyError, TypeError, OverflowError) as error:
        raise place.error(name, box, "{x, y, z}, {size} or {min, max}") from error


def _edge(place: _Place, name: str, edge: Any) -> float:  # noqa: ANN401 - JSON
    is_number = isinstance(edge, int | float) and not isinstance(edge, bool)
    if not is_number or not 0.0 < edge <= MAX_EDGE_M:
        raise place.error(name, edge, f"metres, more than 0 and at most {MAX_EDGE_M:g}")
    return max(MIN_EDGE_M, float(edge))


def _category(place: _Place, category: Any) -> str:  # noqa: ANN401 - JSON
    """Return a category in ProcTHOR's spelling: `dining table` becomes `DiningTable`, `tv stand` becomes `TVStand`."""
    parts = re.findall(r"[A-Za-z0-9]+", category) if isinstance(category, str) else []
    if not parts:
        raise place.error("category", category, "a name such as `DiningTable`")
    return _known_categories().get("".join(parts).lower(), "".join(part[0].upper() + part[1:] for part in parts))


@cache
def _known_categories() -> dict[str, str]:
    """Return the catalogue's categories by their names in lower case."""
    return {category.lower(): category for _, category, _ in _core.assets()}
