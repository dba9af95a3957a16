"""What each reading of the paper's open points does to its statistics: `python scripts/try_readings.py HOUSES...`.

A trial of Algorithm 1 that shares nothing with the generator but its houses: no pictures, no refusals, no placing; all
that a modification is to move does move. Printed as the table of docs/dataset.md, reweighted to ProcTHOR-10k's rooms.
"""

import argparse
import random
from collections import Counter, defaultdict, deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from evonav._core import assets
from evonav.errors import HouseError
from evonav.house import House, stream_houses
from evonav.statistics import weighted_quantiles
from evonav.tasks.statistics import reweight

MODES = ("SALIENT_OBJECT", "RETAIN_GROUP", "FULL_SHUFFLE")
SALIENT = 0
COLUMNS = (
    "relocated",
    *MODES,
    "median ratio",
    "same room again",
    "in changed room",
    "moved",
    "relocated, all stages",
)
"""Goals of stages 2 and on that were relocated; goals moved by the change, if it was of a mode; and so on."""
HUNG_M = 0.08
"""A root object whose bottom is higher hangs on a wall."""
HEIGHTS_M = {asset: size_m[1] for asset, _, size_m in assets()}


@dataclass(frozen=True)
class Reading:
    """One way to read the open points."""

    child_weight: float = 9.0
    salience_by_load: bool = True
    goal_window: int = 1
    changed_window: int = 1
    walls_are_goals: bool = False
    walls_move: bool = False


READINGS = {
    "ours": Reading(),
    "weight 9 for the salient object alone": Reading(child_weight=1),
    "salience uniform": Reading(salience_by_load=False),
    "last two goal rooms": Reading(goal_window=2),
    "walls are goals": Reading(walls_are_goals=True),
    "alone, salience uniform": Reading(child_weight=1, salience_by_load=False),
    "alone, last two goal rooms": Reading(child_weight=1, goal_window=2),
    "alone, change recent for two": Reading(child_weight=1, changed_window=2),
    "alone, walls are goals": Reading(child_weight=1, walls_are_goals=True),
    "alone, walls are goals and move": Reading(child_weight=1, walls_are_goals=True, walls_move=True),
}


class Home:
    """A house as rooms with things in them."""

    def __init__(self, house: House) -> None:
        """Takes rooms by index; things in no room are left out."""
        rooms = {room.id: i for i, room in enumerate(house.rooms)}
        things = [thing for thing in house.objects if thing.room_id in rooms]
        index = {thing.id: i for i, thing in enumerate(things)}
        self.num_rooms, self.num_objects = len(rooms), len(house.objects)
        self.room = [rooms[str(thing.room_id)] for thing in things]
        self.category = [thing.category or thing.asset_id for thing in things]
        self.parent = [None if thing.parent_id is None else index.get(thing.parent_id) for thing in things]
        bottoms_m = [thing.position_m[1] - HEIGHTS_M.get(thing.asset_id, 0.5) / 2 for thing in things]
        self.is_hung = [
            parent is None and bottom_m > HUNG_M for parent, bottom_m in zip(self.parent, bottoms_m, strict=True)
        ]
        self.things_in = [[i for i, room in enumerate(self.room) if room == r] for r in range(self.num_rooms)]
        start = house.start
        room_id = None if start is None else house.room_of(start[0][0], start[0][2])
        self.start = None if room_id is None else rooms[room_id]
        self.neighbours: list[set[int]] = [set() for _ in rooms]
        ways = [door.room_ids for door in house.doors]
        by_place = defaultdict(list)
        for wall in house.walls:
            if wall.is_empty:
                by_place[tuple(sorted(((*wall.from_m,), (*wall.to_m,))))].append(wall.room_id)
        ways += [(ids[0], ids[1]) for ids in by_place.values() if len(ids) == 2]
        for one, other in ways:
            if one in rooms and other in rooms and one != other:
                self.neighbours[rooms[one]].add(rooms[other])
                self.neighbours[rooms[other]].add(rooms[one])

    def carried_by(self, thing: int) -> list[int]:
        """It and all that stands on it."""
        children = [i for i, parent in enumerate(self.parent) if parent == thing]
        return [thing, *(below for child in children for below in self.carried_by(child))]

    def way(self, start: int, goal: int) -> list[int]:
        """Rooms of a way through the fewest."""
        before: dict[int, int | None] = {start: None}
        queue = deque([start])
        while queue:
            room = queue.popleft()
            for other in sorted(self.neighbours[room] - before.keys()):
                before[other] = room
                queue.append(other)
        rooms, at = [], goal if goal in before else None
        while at is not None:
            rooms.append(at)
            at = before[at]
        return [*rooms, goal]


@dataclass
class Trial:
    """What became of one task: by measure, how often it held and how often it could have."""

    sums: defaultdict[str, list[int]]
    ratio: float = 0.0

    def add(self, key: str, is_so: bool) -> None:
        """Counts one."""
        self.sums[key][0] += is_so
        self.sums[key][1] += 1


def choose(rng: random.Random, weights: Sequence[float]) -> int | None:
    """An index, in proportion to its weight; `None` if all are 0."""
    return rng.choices(range(len(weights)), weights)[0] if sum(weights) > 0 else None


def run(home: Home, reading: Reading, rng: random.Random) -> Trial:
    """One task."""
    trial, at = Trial(defaultdict(lambda: [0, 0])), home.start or 0
    visited, goal_rooms, relocated = {at}, list[int](), set[int]()
    changed: list[int | None] = []
    goals = [i for i, is_hung in enumerate(home.is_hung) if reading.walls_are_goals or not is_hung]
    in_house = Counter(home.category[i] for i in goals)
    in_room = Counter((home.category[i], home.room[i]) for i in goals)
    scores = [0.0] * home.num_rooms
    for i in goals:
        is_unique = in_house[home.category[i]] == 1
        scores[home.room[i]] += 2 if is_unique else 1.5 if in_room[home.category[i], home.room[i]] == 1 else 1
    for stage in range(1, rng.choice((3, 4, 5)) + 1):
        room, salient, moved, mode = None, None, set[int](), None
        if stage > 1 and rng.random() < 0.5:
            recent = changed[-reading.changed_window :]
            weights = [
                len(home.things_in[r]) * (3 if r in visited else 1) * (0.5 if r in recent else 1) * (r != at)
                for r in range(home.num_rooms)
            ]
            room, mode = choose(rng, weights), choose(rng, (0.5, 0.4, 0.1))
            if room is not None and mode == SALIENT:
                roots = [i for i in home.things_in[room] if home.parent[i] is None and not home.is_hung[i]]
                loads = [len(home.carried_by(i)) if reading.salience_by_load else 1 for i in roots]
                drawn = choose(rng, loads)
                salient = None if drawn is None else roots[drawn]
                moved, room = (set(), None) if salient is None else (set(home.carried_by(salient)), room)
            elif room is not None:
                moved = {i for i in home.things_in[room] if reading.walls_move or not home.is_hung[i]}
        if stage > 1:
            changed.append(room)
        relocated |= moved
        weights = [score * (9 if r == room else 1) for r, score in enumerate(scores)]
        for earlier in goal_rooms[-reading.goal_window :]:
            weights[earlier] *= 0.2
        goal_room = choose(rng, weights)
        if goal_room is None:
            break
        there = [i for i in goals if home.room[i] == goal_room]
        weights = [
            9 if i == salient else reading.child_weight if salient is not None and i in moved else 1 for i in there
        ]
        target = there[choose(rng, weights) or 0]
        trial.add("relocated, all stages", target in relocated)
        if stage > 1:
            trial.add("relocated", target in relocated)
        if room is not None and mode is not None:
            trial.add("in changed room", goal_room == room)
            trial.add("moved", target in moved)
            trial.add(MODES[mode], target in moved)
        visited.update(home.way(at, goal_room))
        at = goal_room
        goal_rooms.append(goal_room)
    for earlier, later in pairwise(changed):
        if earlier is not None and later is not None:
            trial.add("same room again", earlier == later)
    trial.ratio = len(relocated) / home.num_objects
    return trial


def row(homes: Sequence[Home], weights: Sequence[float], reading: Reading, num_tasks: int, seed: int) -> list[float]:
    """The measures of `COLUMNS`, in %."""
    rng = random.Random(seed)
    sums: defaultdict[str, list[float]] = defaultdict(lambda: [0.0, 0.0])
    ratios = []
    for home, weight in zip(homes, weights, strict=True):
        for _ in range(num_tasks):
            trial = run(home, reading, rng)
            ratios.append(trial.ratio)
            for key, (above, below) in trial.sums.items():
                sums[key][0] += weight * above
                sums[key][1] += weight * below
    median = weighted_quantiles(np.array(ratios), np.repeat(weights, num_tasks), [0.5])[0]
    shares = {key: above / below for key, (above, below) in sums.items()} | {"median ratio": float(median)}
    return [100 * shares[column] for column in COLUMNS]


def houses_of(path: Path) -> Iterator[House]:
    """Houses up to the first that cannot be read."""
    try:
        yield from stream_houses(path)
    except HouseError as error:
        print(f"skipped the rest of {path}: {error}")


def main() -> None:
    """Prints a line a reading."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("houses", nargs="+", type=Path)
    parser.add_argument("--tasks", type=int, default=16, help="a house")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    found = [house for path in arguments.houses for house in houses_of(path) if len(house.rooms) > 1]
    homes = [home for home in map(Home, found) if home.start is not None]
    weights = reweight("procthor-10k", [home.num_rooms for home in homes], [None] * len(homes)).weights
    print(f"{len(homes)} houses, {arguments.tasks} tasks each")
    print(f"| reading | {' | '.join(COLUMNS)} |")
    for name, reading in READINGS.items():
        values = row(homes, weights.tolist(), reading, arguments.tasks, arguments.seed)
        print(f"| {name} | {' | '.join(f'{value:.1f}' for value in values)} |", flush=True)


if __name__ == "__main__":
    main()
