"""Check the physics of stage houses independently, with Shapely, from house JSON and shapes.

Nothing of the generator's placement, collision or navigation is used; only the asset catalogue's sizes and shapes
(`House.footprints`) and the task's files. By hand, over many houses:

    python tests/generation/shapely_physics.py HOUSES.jsonl.gz FOLDER_OF_TASKS ...
"""

import itertools
import json
import math
import sys
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from evonav.errors import EvonavError
from evonav.generation import GenerationParameters, generate_task
from evonav.house import House, stream_houses
from evonav.tasks import Task, load_tasks

AGENT_RADIUS_M, AGENT_HEIGHT_M = 0.2, 1.8
"""AI2-THOR's default agent, a capsule."""
STEP_M = 0.03
"""Obstacles that end below this height are walked over."""
SLACK_M = 0.01
"""Largest depth of the agent in an obstacle; scenes are not exact."""
DEPTH_M = 0.012
"""Smallest overlap of two objects that is a problem; boxes of the catalogue are off by up to 7 mm."""
REST_M = 0.02
"""Smallest gap at which an object hovers over its support."""
ROOM_M2 = 0.02
"""Smallest free floor area of a room in which the agent can stand."""


@dataclass(frozen=True)
class Problem:
    """A physical problem."""

    kind: str
    task_id: str
    stage: int
    object_id: str
    detail: str


@dataclass(frozen=True)
class Part:
    """A convex part: its outline on the floor plan and its heights."""

    outline: BaseGeometry
    low_m: float
    high_m: float


@dataclass(frozen=True)
class Thing:
    """An object of a house."""

    id: str
    category: str
    parent_id: str | None
    parts: tuple[Part, ...]

    @cached_property
    def shadow(self) -> BaseGeometry:
        return shapely.union_all([part.outline for part in self.parts])

    @property
    def low_m(self) -> float:
        return min(part.low_m for part in self.parts)

    @property
    def high_m(self) -> float:
        return max(part.high_m for part in self.parts)


class Plan:
    """A stage house as geometry."""

    def __init__(self, house_json: str) -> None:
        document = json.loads(house_json)
        self.things = {thing.id: thing for thing in _things(house_json, document)}
        self.rooms = {
            room["id"]: shapely.make_valid(shapely.Polygon([(p["x"], p["z"]) for p in room["floorPolygon"]]))
            for room in document["rooms"]
        }
        self.walls = _solid_walls(document)
        self.floor = shapely.union_all([room.buffer(0.01) for room in self.rooms.values()])

    def room_of(self, shadow: BaseGeometry) -> str | None:
        """Return the room that contains most of the object."""
        shares = {name: room.intersection(shadow).area for name, room in self.rooms.items()}
        best = max(shares, key=lambda name: shares[name])
        return best if shares[best] > 0.0 else None

    def free_floor(self) -> BaseGeometry:
        """The possible positions of the agent's axis."""
        near = [(part.outline, _reach_m(part)) for thing in self.things.values() for part in thing.parts]
        near = [(self.walls, AGENT_RADIUS_M - SLACK_M), *(pair for pair in near if pair[1] > 0.0)]
        grown = shapely.buffer([shape for shape, _ in near], [reach_m for _, reach_m in near], quad_segs=4)
        return self.floor.difference(shapely.union_all(grown))


def problems_of(task: Task) -> list[Problem]:
    """Yield the problems in the stage houses of a task that the house before did not have."""
    found: list[Problem] = []
    by_text = {text: Plan(text) for text in dict.fromkeys(task.houses_json)}
    plans = [by_text[text] for text in task.houses_json]
    free = None
    source_free = plans[0].free_floor()
    must_reach = _reached(source_free, plans[0], task.header.start_pose.position_m)
    for k in range(1, task.num_stages + 1):
        oracle, plan = task.oracle(k), plans[k - 1]
        if k > 1:
            before = plans[k - 2]
            moved = [change.id for change in oracle.evolution.changes]
            for kind, name, detail in itertools.chain(
                _outside(before, plan, moved), _overlaps(before, plan, moved), _unsupported(before, plan, moved)
            ):
                found.append(Problem(kind, task.task_id, k, name, detail))
        if free is None or oracle.evolution.changes:
            free = plan.free_floor()
        pose = shapely.Point(oracle.reference_pose.position_m[0], oracle.reference_pose.position_m[2])
        if free.distance(pose) > 0.005:
            found.append(
                Problem("reference pose", task.task_id, k, oracle.target.id, f"{free.distance(pose):.3f} m off")
            )
        reached = _reached(free, plan, oracle.reference_pose.position_m)
        for room in sorted(must_reach - reached):
            found.append(Problem("cut off", task.task_id, k, room, "was reached from the start in the source house"))
    return found


def _things(house_json: str, document: dict) -> Iterator[Thing]:
    parents = {}
    for root in document["objects"]:
        for child in _flat(root):
            for below in child.get("children") or []:
                parents[below["id"]] = child["id"]
    for name, category, parts in House(house_json, name="stage").footprints(allow_unknown_assets=True):
        solid = [
            Part(shapely.Polygon(outline) if len(outline) > 2 else shapely.MultiPoint(outline).envelope, low, high)
            for outline, low, high in parts
            if outline
        ]
        if solid:
            yield Thing(name, category, parents.get(name), tuple(solid))


def _flat(record: dict) -> Iterator[dict]:
    yield record
    for child in record.get("children") or []:
        yield from _flat(child)


def _solid_walls(document: dict) -> BaseGeometry:
    """Return the wall lines without open boundaries and open doorways."""
    lines, holes = [], []
    ends = {}
    for wall in document["walls"]:
        points = list(dict.fromkeys((p["x"], p["z"]) for p in wall["polygon"]))
        if len(points) < 2:
            continue
        ends[wall["id"]] = points[:2]
        if not wall.get("empty"):
            lines.append(shapely.LineString(points[:2]))
    for door in document["doors"]:
        is_shut = door.get("openable") and not door.get("openness")
        if is_shut or door["wall0"] not in ends:
            continue
        (x0, z0), (x1, z1) = ends[door["wall0"]]
        length_m = math.hypot(x1 - x0, z1 - z0) or 1.0
        corners = door["holePolygon"] if "holePolygon" in door else door["boundingBox"].values()  # schema 0.0.1
        along = [p["x"] / length_m for p in corners]
        cut = shapely.LineString([(x0 + (x1 - x0) * t, z0 + (z1 - z0) * t) for t in (min(along), max(along))])
        holes.append(cut.buffer(0.06, cap_style="flat"))
    return shapely.union_all(lines).difference(shapely.union_all(holes))


def _reach_m(part: Part) -> float:
    """Return the least distance of the capsule's axis from a part; its ends are round, for low and high parts."""
    if part.high_m <= STEP_M or part.low_m >= AGENT_HEIGHT_M:
        return 0.0
    radius_m = AGENT_RADIUS_M - SLACK_M
    beyond_m = max(radius_m - part.high_m, part.low_m - (AGENT_HEIGHT_M - radius_m), 0.0)
    return math.sqrt(max(radius_m**2 - beyond_m**2, 0.0))


def _reached(free: BaseGeometry, plan: Plan, from_m: tuple[float, float, float]) -> set[str]:
    """Return the rooms that the agent can reach."""
    start = shapely.Point(from_m[0], from_m[2])
    pieces = list(getattr(free, "geoms", [free]))
    own = min(pieces, key=lambda piece: piece.distance(start))
    return {name for name, room in plan.rooms.items() if room.intersection(own).area > ROOM_M2}


def _outside(before: Plan, plan: Plan, moved: Iterable[str]) -> Iterator[tuple[str, str, str]]:
    """Yield moved objects that extend out of their room or through a wall, further than before."""
    for name in moved:
        shadow = plan.things[name].shadow
        room = plan.room_of(shadow)
        if room is None:
            yield "outside", name, "in no room"
            continue
        depth_m = _depth_out_m(shadow, plan.rooms[room])
        old = before.things[name].shadow
        old_room = before.room_of(old)
        old_m = 0.0 if old_room is None else _depth_out_m(old, before.rooms[old_room])
        if depth_m > max(DEPTH_M, old_m + 0.005):
            # Over an open-plan border is still in the house: only a wall is hit.
            inner = shadow.buffer(-DEPTH_M)
            if inner.intersects(plan.walls) or not plan.floor.covers(inner):
                yield (
                    "in wall",
                    name,
                    f"{plan.things[name].category} {depth_m:.3f} m through a wall, before {old_m:.3f}",
                )
            else:
                yield "other room", name, f"{plan.things[name].category} {depth_m:.3f} m over an open border"


def _depth_out_m(shadow: BaseGeometry, room: BaseGeometry) -> float:
    rest = shadow.difference(room)
    if rest.is_empty:
        return 0.0
    return max(room.distance(shapely.Point(point)) for point in shapely.get_coordinates(rest))


def _overlaps(before: Plan, plan: Plan, moved: Iterable[str]) -> Iterator[tuple[str, str, str]]:
    """Yield moved objects that overlap others, deeper than before."""
    names = list(plan.things)
    tree = shapely.STRtree([plan.things[name].shadow.envelope for name in names])
    seen = set()
    for name in moved:
        thing = plan.things[name]
        for index in tree.query(thing.shadow.envelope):
            other = plan.things[names[index]]
            pair = frozenset((name, other.id))
            if len(pair) == 1 or pair in seen or name == other.parent_id or thing.parent_id == other.id:
                continue
            seen.add(pair)
            depth_m = _overlap_m(thing, other)
            if depth_m <= DEPTH_M:
                continue
            old_m = _overlap_m(before.things[name], before.things[other.id]) if other.id in before.things else 0.0
            if depth_m > old_m + 0.005:
                yield "overlap", name, f"{thing.category} in {other.category} {other.id} by {depth_m:.3f} m"


def _overlap_m(a: Thing, b: Thing) -> float:
    """Return the depth of two objects in each other: over pairs of parts, the least overlap along plan and height."""
    deepest_m = 0.0
    for p, q in itertools.product(a.parts, b.parts):
        height_m = min(p.high_m, q.high_m) - max(p.low_m, q.low_m)
        if height_m <= deepest_m or not p.outline.intersects(q.outline):
            continue
        deepest_m = max(deepest_m, min(height_m, _width_m(p.outline.intersection(q.outline))))
    return deepest_m


def _width_m(shape: BaseGeometry) -> float:
    """Return the least width of a convex shape: over its edges, its extent from the edge's line."""
    if shape.area == 0.0:
        return 0.0
    corners = shapely.get_coordinates(shape.convex_hull)[:-1]
    edges = np.roll(corners, -1, axis=0) - corners
    normals = np.stack([-edges[:, 1], edges[:, 0]], axis=1) / np.linalg.norm(edges, axis=1, keepdims=True)
    reach_m = np.abs(np.einsum("eij,ej->ei", corners[None] - corners[:, None], normals)).max(axis=1)
    return float(reach_m.min())


def _unsupported(before: Plan, plan: Plan, moved: Iterable[str]) -> Iterator[tuple[str, str, str]]:
    """Yield moved objects that hover or extend beyond their support, and did not before."""
    for name in moved:
        fault = _rest_fault(plan, name)
        if fault is not None and _rest_fault(before, name) is None:
            yield fault[0], name, f"{plan.things[name].category} {fault[1]}"


def _rest_fault(plan: Plan, name: str) -> tuple[str, str] | None:
    thing = plan.things[name]
    if thing.parent_id is None:
        return ("floats", f"{thing.low_m:.3f} m above the floor") if abs(thing.low_m) > REST_M else None
    parent = plan.things[thing.parent_id]
    middle = thing.shadow.centroid
    if not parent.shadow.buffer(0.01).covers(middle):
        return ("beside", f"its middle is {parent.shadow.distance(middle):.3f} m off the {parent.category}")
    gaps_m = [
        thing.low_m - part.high_m
        for part in parent.parts
        if part.outline.intersects(thing.shadow) and part.high_m <= thing.low_m + REST_M
    ]
    if not gaps_m or min(gaps_m) > REST_M:
        gap = f"{min(gaps_m):.3f} m above" if gaps_m else "no surface below"
        return ("floats", f"{gap} on the {parent.category}")
    return None


def main() -> None:
    """Print the problems in tasks of folders, and in tasks that evolve at every transition from files of houses."""
    counts: Counter[str] = Counter()
    for path in sys.argv[1:]:
        for task in load_tasks(path) if Path(path).is_dir() else _tasks(path):
            counts["(tasks)"] += 1
            for problem in problems_of(task):
                counts[problem.kind] += 1
                print(problem, flush=True)
    print(dict(counts))


def _tasks(path: str) -> Iterator[Task]:
    for house in stream_houses(path):
        with suppress(EvonavError):
            parameters = GenerationParameters(evolve_probability=1.0)
            yield generate_task(house, seed=0, config=parameters, allow_unknown_assets=True)


if __name__ == "__main__":
    main()
