"""Check a task's change records against the JSON of its houses."""

import math
from collections.abc import Iterator
from typing import Any, NamedTuple, get_args

from evonav.generation.validation.problems import ProblemKind
from evonav.house import House
from evonav.tasks.manifest import Task
from evonav.tasks.oracle import Change, Evolution, Mode, ObjectRecord

MODES = frozenset(get_args(Mode))
SAME_M = 1e-6

Found = tuple[ProblemKind, str]
"""A problem: its kind and its detail."""


class Entry(NamedTuple):
    """An object in a house file."""

    position_m: tuple[float, ...]
    rotation_deg: tuple[float, ...]
    support_id: str | None
    rest: dict[str, Any]
    """All other fields."""


def entries_of(document: dict[str, Any]) -> dict[str, Entry]:
    """Return the objects of a house by id."""
    found: dict[str, Entry] = {}

    def collect(objects: list[dict[str, Any]], support_id: str | None) -> None:
        for one in objects:
            rest = {key: value for key, value in one.items() if key not in ("position", "rotation", "children")}
            position, rotation = (tuple(float(one[key][axis]) for axis in "xyz") for key in ("position", "rotation"))
            found[str(one["id"])] = Entry(position, rotation, support_id, rest)
            collect(one.get("children") or [], str(one["id"]))

    collect(document.get("objects", []), None)
    return found


def check_changes(before: dict[str, Any], after: dict[str, Any], evolution: Evolution, rooms: House) -> Iterator[Found]:
    """Yield the differences between the record of a change and the houses before and after it.

    Args:
        before: House before the change, JSON.
        after: House after it, JSON.
        rooms: House of the stage, for its rooms.
    """
    old, new = entries_of(before), entries_of(after)
    moved = {i for i in old.keys() & new.keys() if old[i][:3] != new[i][:3]}
    yield from _same_ids("changes", [change.id for change in evolution.changes], moved)
    yield from _same_ids("additions", [one.id for one in evolution.additions], new.keys() - old.keys())
    yield from _same_ids("removals", [one.id for one in evolution.removals], old.keys() - new.keys())
    for change in evolution.changes:
        if change.id in moved:
            yield from _check_poses(change, old[change.id], new[change.id])
        if change.cause in MODES:
            yield from _check_room(change, evolution, rooms)
    yield from _check_objects("additions", evolution.additions, new)
    yield from _check_objects("removals", evolution.removals, old)
    yield from _check_states(before, after, old, new, evolution)
    causes = {change.cause for change in evolution.changes}
    if (evolution.outcome == "evolved") != bool(causes):
        yield "change_record", f"outcome is {evolution.outcome!r}, causes of the changes are {sorted(map(str, causes))}"
    if not causes & MODES <= {evolution.mode}:
        yield "change_record", f"mode is {evolution.mode!r}, causes of the changes are {sorted(map(str, causes))}"


def check_relocation(task: Task, stage: int) -> Iterator[Found]:
    """Check displacements and the objects relocated so far."""
    oracle = task.oracle(stage)
    yield from check_displacements(oracle.evolution, task.header.parameters.relocated_min_m)
    evolutions = task.evolutions_before(stage)
    ever = {i for earlier in evolutions for i in earlier.relocated_ids}
    removed = {one.id for earlier in evolutions for one in earlier.removals}
    recorded = oracle.ever_relocated_ids
    if set(recorded) - removed != ever - removed or list(recorded) != sorted(set(recorded)):
        differing = sorted((set(recorded) ^ ever) - removed)
        yield "relocation", f"ever_relocated_ids does not agree with the changes, sorted: {differing[:5]}"
    for name, expected in (("now", oracle.evolution.relocated_ids), ("ever", ever)):
        if getattr(oracle.target, f"is_relocated_{name}") != (oracle.target.id in expected):
            yield "relocation", f"target.is_relocated_{name} does not agree with the changes"


def check_displacements(evolution: Evolution, relocated_min_m: float) -> Iterator[Found]:
    """Check the lengths of moves, and which of them count as relocations."""
    for change in evolution.changes:
        distance_m = math.dist(change.from_position_m, change.to_position_m)
        if abs(distance_m - change.displacement_m) > SAME_M:
            yield "relocation", f"{change.id}: displacement_m is {change.displacement_m}, moved {distance_m}"
        is_far = distance_m > relocated_min_m
        if change.is_relocated != (is_far or change.from_support_id != change.to_support_id):
            yield "relocation", f"{change.id}: is_relocated is {change.is_relocated}, moved {distance_m:.4f} m"


def _same_ids(name: str, recorded: list[str], found: set[str]) -> Iterator[Found]:
    if len(set(recorded)) < len(recorded):
        yield "change_record", f"evolution.{name} names an object twice"
    for one in sorted(found - set(recorded)):
        yield "change_record", f"evolution.{name} lacks {one}"
    for one in sorted(set(recorded) - found):
        yield "change_record", f"evolution.{name} lists {one}, but the houses do not differ in it"


def _check_poses(change: Change, old: Entry, new: Entry) -> Iterator[Found]:
    for side, entry in (("from", old), ("to", new)):
        for field in ("position_m", "rotation_deg", "support_id"):
            recorded, found = getattr(change, f"{side}_{field}"), getattr(entry, field)
            if recorded != found:
                yield "change_record", f"{change.id}: {side}_{field} is {recorded}, in the house {found}"


def _check_room(change: Change, evolution: Evolution, rooms: House) -> Iterator[Found]:
    for name, (x_m, _, z_m) in (("from", change.from_position_m), ("to", change.to_position_m)):
        room = rooms.room_of(x_m, z_m)
        if room != evolution.room_id:
            yield "change_record", f"{change.id}: moved {name} {room}, while {evolution.room_id} evolves"


def _check_objects(name: str, recorded: tuple[ObjectRecord, ...], house: dict[str, Entry]) -> Iterator[Found]:
    for one in recorded:
        if one.id in house:
            entry = house[one.id]
            found = (entry.position_m, entry.rotation_deg, entry.support_id, entry.rest.get("assetId"))
            if found != (one.position_m, one.rotation_deg, one.support_id, one.asset_id):
                yield "change_record", f"{one.id}: in evolution.{name} not as in the house"


def _check_states(
    before: dict[str, Any],
    after: dict[str, Any],
    old: dict[str, Entry],
    new: dict[str, Entry],
    evolution: Evolution,
) -> Iterator[Found]:
    """Check that exactly the fields of the state record have changed, apart from poses."""
    recorded = {(state.id, state.field): state for state in evolution.states}
    pairs = [(i, old[i].rest, new[i].rest) for i in old.keys() & new.keys()]
    doors_before, doors_after = (
        {str(door["id"]): door for door in house.get("doors", [])} for house in (before, after)
    )
    pairs += [(i, doors_before[i], doors_after.get(i, {})) for i in doors_before]
    seen = set()
    for one, then, now in sorted(pairs, key=lambda pair: pair[0]):
        for field in sorted(key for key in then.keys() | now.keys() if then.get(key) != now.get(key)):
            state = recorded.get((one, field))  # type: ignore[arg-type]
            seen.add((one, field))
            if state is None:
                yield "change_record", f"{one}: {field} differs, but evolution.states does not list it"
            elif float(now.get(field, 0.0)) != state.after or float(then.get(field, state.before)) != state.before:
                yield "change_record", f"{one}: {field} differs from evolution.states"
    for one, field in sorted(recorded.keys() - seen):
        yield "change_record", f"evolution.states lists {field} of {one}, but the houses do not differ in it"
    for key in sorted(before.keys() | after.keys() - {"objects", "doors"}):
        if key not in ("objects", "doors") and before.get(key) != after.get(key):
            yield "change_record", f"`{key}` of the house differs"
