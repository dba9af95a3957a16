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
from typing import Annotated, Any

from pydantic import AfterValidator, Field, ValidationError

from evonav import _core
from evonav.errors import HouseError
from evonav.records import Record, sentence_of

MIN_EDGE_M, MAX_EDGE_M = 0.001, 30.0
KEY = "evonav_assets"
"""Key of a house's `metadata` that holds the sizes."""


def _known_spelling(category: str) -> str:
    """Return a category in ProcTHOR's spelling: `dining table` becomes `DiningTable`, `tv stand` becomes `TVStand`."""
    parts = re.findall(r"[A-Za-z0-9]+", category)
    if not parts:
        raise ValueError("expected a name such as `DiningTable`")
    return _known_categories().get("".join(parts).lower(), "".join(part[0].upper() + part[1:] for part in parts))


Edge = Annotated[float, Field(gt=0.0, le=MAX_EDGE_M), AfterValidator(lambda edge_m: max(MIN_EDGE_M, edge_m))]
"""Edge of a box in metres."""


class AssetSize(Record):
    """An asset's size, category and flags, in evonav's own format."""

    size_m: Annotated[tuple[Edge, Edge, Edge], Field(strict=False)]
    """Edges of the box at zero rotation, `(x, y, z)` with y up."""
    category: Annotated[str, AfterValidator(_known_spelling)]
    pickupable: bool = False
    moveable: bool = False
    receptacle: bool = False
    openable: bool = False


@dataclass(frozen=True, slots=True)
class AssetSizes:
    """Sizes of assets by id, from one file."""

    path: Path
    entries: Mapping[str, AssetSize] = field(repr=False)

    def embed(self, document: dict[str, Any]) -> bool:
        """Write the entries of all assets that a house uses and the catalogue lacks into its metadata; true if any."""
        used = sorted({str(item.get("assetId")) for item in each_object(document)} & self.entries.keys())
        found = {
            asset_id: self.entries[asset_id].model_dump(mode="json", exclude_defaults=True)
            for asset_id in used
            if asset_id not in catalogue_ids()
        }
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

    An entry is evonav's own (`AssetSize`) or an annotation of Objaverse assets as objathor and Holodeck publish them,
    whose box `thor_metadata.assetMetadata.boundingBox` is used. Annotations without a box are left out.

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
    found: dict[str, AssetSize] = {}
    for asset_id, entry in entries.items():
        try:
            if (own := _own_form(entry)) is not None:
                found[asset_id] = AssetSize.model_validate(own)
        except ValidationError as error:
            raise HouseError(f"{path}: asset {asset_id}: {sentence_of(error)}") from error
        except (AttributeError, KeyError, TypeError, OverflowError) as error:
            message = "the annotation has no boundingBox {x, y, z}, {size} or {min, max}"
            raise HouseError(f"{path}: asset {asset_id}: {message}: {error!r}") from error
    return AssetSizes(path, found)


def _own_form(entry: Any) -> Any:  # noqa: ANN401 - JSON
    """Return an annotation in the form of `AssetSize`, and anything else as it is; `None` for one without a box."""
    if not isinstance(entry, dict) or not entry.keys() & {
        *("annotations", "thor_metadata", "assetMetadata", "onFloor", "uid")
    }:
        return entry
    labels = entry.get("annotations", entry)
    metadata = entry.get("assetMetadata") or (entry.get("thor_metadata") or {}).get("assetMetadata") or {}
    box = metadata.get("boundingBox")
    if box is None:
        return None
    edges_m = box.get("size", box)
    if "min" in box and "max" in box:
        edges_m = {axis: box["max"][axis] - box["min"][axis] for axis in "xyz"}
    primary, secondary = metadata.get("primaryProperty"), metadata.get("secondaryProperties") or ()
    return {
        "size_m": [edges_m[axis] for axis in "xyz"],
        "category": labels.get("category"),
        "pickupable": primary == "CanPickup",
        "moveable": primary == "Moveable",
        "receptacle": labels.get("receptacle") is True or "Receptacle" in secondary,
        "openable": "CanOpen" in secondary,
    }


@cache
def _known_categories() -> dict[str, str]:
    """Return the catalogue's categories by their names in lower case."""
    return {category.lower(): category for _, category, _ in _core.assets()}
