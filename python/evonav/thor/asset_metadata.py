"""What AI2-THOR says of an asset besides its shape."""

import json
from collections import Counter
from dataclasses import dataclass, field
from functools import cache
from importlib import resources

_Vec3 = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class AssetFacts:
    """Facts of an asset, as AI2-THOR's records name them; `scripts/build_thor_assets.py` makes the table."""

    object_type: str
    flags: frozenset[str] = frozenset()
    """`pickupable`, `openable` and the like, where true."""
    first_states: frozenset[str] = frozenset()
    """`isOpen`, `isToggled`, `isFilledWithLiquid`, where a new one is so."""
    mass_kg: float = 0.0
    materials: tuple[str, ...] | None = None
    """`salientMaterials`; records that give them give the mass."""
    size_m: _Vec3 | None = None
    """Of its box."""
    pivot_m: _Vec3 = field(default=(0.0, 0.0, 0.0))
    """`position`, seen from the middle of the box in the asset's own frame."""

    @property
    def is_movable(self) -> bool:
        """Whether it can be picked up or pushed; the rest has no `objectOrientedBoundingBox`."""
        return not self.flags.isdisjoint(("pickupable", "moveable"))


def facts_of(asset_id: str, object_type: str) -> AssetFacts:
    """Facts of an asset; of one that the table does not hold (Objaverse's), those most common to its type."""
    return _by_asset().get(asset_id) or _by_type().get(object_type) or AssetFacts(object_type)


@cache
def _by_asset() -> dict[str, AssetFacts]:
    text = (resources.files("evonav.thor") / "data" / "assets.json").read_text(encoding="utf-8")
    return {
        row["id"]: AssetFacts(
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
def _by_type() -> dict[str, AssetFacts]:
    groups: dict[str, list[AssetFacts]] = {}
    for facts in _by_asset().values():
        groups.setdefault(facts.object_type, []).append(facts)
    return {object_type: _typical(object_type, group) for object_type, group in groups.items()}


def _typical(object_type: str, group: list[AssetFacts]) -> AssetFacts:
    flags, _ = Counter(facts.flags for facts in group).most_common(1)[0]
    materials, _ = Counter(facts.materials for facts in group).most_common(1)[0]
    masses_kg = sorted(facts.mass_kg for facts in group)
    states, _ = Counter(facts.first_states for facts in group).most_common(1)[0]
    return AssetFacts(object_type, flags, states, masses_kg[len(group) // 2] if materials else 0.0, materials)
