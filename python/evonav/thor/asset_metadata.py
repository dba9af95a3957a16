"""Read what AI2-THOR records of an asset besides its shape."""

import json
from collections import Counter
from dataclasses import dataclass, field
from functools import cache
from importlib import resources

from evonav.thor.geometry import Vec3


@dataclass(frozen=True, slots=True)
class AssetMetadata:
    """An asset's record in AI2-THOR, besides its shape; `scripts/data/build_thor_assets.py` makes the table."""

    object_type: str
    flags: frozenset[str] = frozenset()
    """Names of the properties that are true: `pickupable`, `openable` and the like."""
    first_states: frozenset[str] = frozenset()
    """Names of the states that a new object is in: `isOpen`, `isToggled`, `isFilledWithLiquid`."""
    mass_kg: float = 0.0
    materials: tuple[str, ...] | None = None
    """AI2-THOR's `salientMaterials`; a record has a mass only if it has these."""
    size_m: Vec3 | None = None
    """Edges of the asset's box, along its own axes."""
    pivot_m: Vec3 = field(default=(0.0, 0.0, 0.0))
    """Offset of `position` from the centre of the box, in the asset's own frame."""

    @property
    def is_movable(self) -> bool:
        """Whether it can be picked up or pushed; other assets have no `objectOrientedBoundingBox`."""
        return not self.flags.isdisjoint(("pickupable", "moveable"))


def metadata_of_asset(asset_id: str, object_type: str) -> AssetMetadata:
    """Return an asset's metadata; for an asset that the table lacks (Objaverse's), what is most common for its type."""
    return _by_asset().get(asset_id) or _by_type().get(object_type) or AssetMetadata(object_type)


@cache
def _by_asset() -> dict[str, AssetMetadata]:
    text = (resources.files("evonav.thor") / "data" / "assets.json").read_text(encoding="utf-8")
    return {
        row["id"]: AssetMetadata(
            row["type"],
            frozenset(row["flags"]),
            frozenset(row.get("states", ())),
            row.get("mass_kg", 0.0),
            tuple(row["materials"]) if "materials" in row else None,
            tuple(row["size_m"]) if "size_m" in row else None,
            tuple(row.get("pivot_m", (0.0, 0.0, 0.0))),
        )
        for row in json.loads(text)["assets"]
    }


@cache
def _by_type() -> dict[str, AssetMetadata]:
    groups: dict[str, list[AssetMetadata]] = {}
    for asset in _by_asset().values():
        groups.setdefault(asset.object_type, []).append(asset)
    return {object_type: _typical(object_type, group) for object_type, group in groups.items()}


def _typical(object_type: str, group: list[AssetMetadata]) -> AssetMetadata:
    flags, _ = Counter(asset.flags for asset in group).most_common(1)[0]
    materials, _ = Counter(asset.materials for asset in group).most_common(1)[0]
    masses_kg = sorted(asset.mass_kg for asset in group)
    states, _ = Counter(asset.first_states for asset in group).most_common(1)[0]
    return AssetMetadata(object_type, flags, states, masses_kg[len(group) // 2] if materials else 0.0, materials)
