"""Check whether houses can be used: their numbers, what is wrong and odd in them, and whether they give a task."""

import json
import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

from evonav import _core
from evonav.counted import counted
from evonav.errors import EvonavError, HouseError, SimulationError
from evonav.generation.pipeline import generate_task
from evonav.generation.validation.problems import KINDS, ProblemKind
from evonav.generation.validation.world import REST_M, TOUCH_M
from evonav.house import House, HouseObject
from evonav.house.asset_sizes import KEY, catalogue_ids
from evonav.world.embedded import EmbeddedSimulator

ROOM_TYPES = ("Bathroom", "Bedroom", "Kitchen", "LivingRoom")
"""Room types of ProcTHOR, for which its placement rules are written."""
MOVED_M = 0.05
"""Distance by which a start may be moved to a free place without a note."""


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that was found in a house."""

    severity: Literal["wrong", "note"]
    """`wrong`: the house gives no task and no run as it is."""
    object_id: str
    field: str
    message: str

    def __str__(self) -> str:
        return f"{self.object_id}: field `{self.field}`: {self.message}" if self.field else self.message


@dataclass(frozen=True, slots=True)
class HouseCheck:
    """The result of the check of a house."""

    name: str
    house: House | None
    """`None` if it cannot be read."""
    findings: tuple[Finding, ...]
    num_places: int = 0
    """Places of the 0.25 m grid that the agent can reach from its start."""

    @property
    def is_fine(self) -> bool:
        """True if nothing is wrong; there may be notes."""
        return all(finding.severity == "note" for finding in self.findings)

    @property
    def summary(self) -> str:
        """The numbers of the house in one line."""
        if self.house is None:
            return "cannot be read"
        house, area_m2 = self.house, sum(area_of_m2(room.polygon_m) for room in self.house.rooms)
        parts = (counted(len(house.rooms), "room"), f"{area_m2:.1f} m2", counted(len(house.objects), "object"))
        categories = {item.category for item in house.objects}
        return f"{', '.join(parts)} of {counted(len(categories), 'category')}, {counted(len(house.doors), 'door')}"

    @property
    def rooms(self) -> list[tuple[str, str, str, str]]:
        """Id, type, floor area in m2 and number of objects of each room."""
        if self.house is None:
            return []
        inside = Counter(item.room_id for item in self.house.objects)
        return [
            (room.id, room.room_type, f"{area_of_m2(room.polygon_m):.1f}", str(inside[room.id]))
            for room in self.house.rooms
        ]


def area_of_m2(outline_m: Sequence[tuple[float, float]]) -> float:
    """Return the area that an outline encloses."""
    following = zip(outline_m, [*outline_m[1:], *outline_m[:1]], strict=True)
    return abs(sum(x0 * z1 - x1 * z0 for (x0, z0), (x1, z1) in following)) / 2.0


def check_house(name: str, text: str, *, allow_unknown_assets: bool = False) -> HouseCheck:
    """Check a house.

    Args:
        text: ProcTHOR JSON.
        allow_unknown_assets: Give assets without a known size the usual one of their category.
    """
    try:
        house = House(text, name=name)
    except HouseError as error:
        return HouseCheck(name, None, (Finding("wrong", "house", "", str(error).removeprefix(f"house {name}: ")),))
    findings = list(_assets(house, allow_unknown_assets))
    if house.start is None:
        message = "is missing, so the house gives no task; `--start auto` chooses a free place"
        findings.append(Finding("wrong", "house", "metadata.agent", message))
    findings += _rooms(house)
    num_places = 0
    if all(finding.field != "assetId" or finding.severity == "note" for finding in findings):
        simulator = EmbeddedSimulator(allow_unknown_assets=allow_unknown_assets)
        try:
            simulator.reset(text, name=name)
        except (HouseError, SimulationError) as error:
            findings.append(Finding("wrong", "house", "", str(error).removeprefix(f"house {name}: ")))
        else:
            findings += _world(house, simulator)
            num_places = len(simulator.reachable_positions())
    return HouseCheck(name, house, tuple(findings), num_places)


def _assets(house: House, allow_unknown_assets: bool) -> Iterator[Finding]:
    """Yield a finding for each asset without a known size."""
    known = catalogue_ids() | (json.loads(house.to_json())["metadata"].get(KEY) or {}).keys()
    unknown: dict[str, list[HouseObject]] = {}
    for item in house.objects:
        if item.asset_id not in known:
            unknown.setdefault(item.asset_id, []).append(item)
    for asset_id, items in unknown.items():
        more = f", also of {len(items) - 1} other objects" if len(items) > 1 else ""
        if allow_unknown_assets:
            message = f"is {asset_id!r}{more}: its size is a guess from its category {items[0].category}"
            yield Finding("note", items[0].id, "assetId", message)
        else:
            message = (
                f"is {asset_id!r}{more}, of which the catalogue knows no size: give a file of sizes (--assets), "
                "or let its category guess one (--allow-unknown-assets)"
            )
            yield Finding("wrong", items[0].id, "assetId", message)


def _rooms(house: House) -> Iterator[Finding]:
    if len(house.rooms) == 1:
        yield Finding("note", "house", "rooms", "is one room; tasks need at least two")
    for room in house.rooms:
        if room.room_type not in ROOM_TYPES:
            message = (
                f"is {room.room_type!r}, none of {', '.join(ROOM_TYPES)}: it keeps this name in goals, objects in it "
                "move as elsewhere, and no new object and no activity is brought into it"
            )
            yield Finding("note", room.id, "roomType", message)
    outside = [item.id for item in house.objects if item.room_id is None]
    if outside:
        shown = ", ".join(outside[:3]) + (f" and {len(outside) - 3} more" if len(outside) > 3 else "")
        yield Finding("note", outside[0], "position", f"is in no room ({shown}); such objects never move")


def _world(house: House, simulator: EmbeddedSimulator) -> Iterator[Finding]:
    """Yield what is odd in the world that the house becomes."""
    if house.start is not None:
        (x_m, _, z_m), _, _ = house.start
        moved_m = math.dist((x_m, z_m), (simulator.pose.x_m, simulator.pose.z_m))
        if moved_m > MOVED_M:
            yield Finding("note", "house", "metadata.agent", f"is not free: the agent starts {moved_m:.2f} m away")
    places = simulator.reachable_positions()
    reached = {house.room_of(float(x), float(z)) for x, _, z in places}
    for room in house.rooms:
        if room.id not in reached:
            yield Finding("note", room.id, "floorPolygon", f"the agent cannot reach this {room.room_type}")


def odd_bodies(house: House, *, allow_unknown_assets: bool = False) -> Counter[ProblemKind]:
    """Count overlaps of objects and objects without support, by kind; published houses have some, too."""
    found = _core.inspect_house(house, house, touch_m=TOUCH_M, rest_m=REST_M, allow_unknown_assets=allow_unknown_assets)
    return Counter(one["kind"] for one in json.loads(found))


def odd_note(found: HouseCheck, *, allow_unknown_assets: bool = False) -> str:
    """Return a sentence on the overlaps and objects without support in a house; empty if there are none."""
    if found.house is None or not found.num_places:
        return ""
    odd = sorted(odd_bodies(found.house, allow_unknown_assets=allow_unknown_assets).items())
    parts = [f"{KINDS[kind]} ({number})" for kind, number in odd]
    return f"{'; '.join(parts)}: published houses have such flaws, too" if parts else ""


def task_outcome(found: HouseCheck, *, allow_unknown_assets: bool = False) -> str:
    """Say whether a house gives a task, and why not."""
    if found.house is None or not found.num_places:
        return "no" if found.house is None else "no: the house is wrong"
    try:
        task = generate_task(found.house, seed=0, allow_unknown_assets=allow_unknown_assets)
    except EvonavError as error:
        return f"no: {str(error).removeprefix(f'house {found.name}: ')}"
    return f"yes: {counted(task.num_stages, 'stage')} with seed 0"
