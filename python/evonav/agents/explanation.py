"""Let an agent explain itself: what it knows and chose, for records and pictures, never for scoring."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from evonav.agents.agent import EntryBelief, PlaceBelief
from evonav.decision.query import QueryLogEntry
from evonav.errors import InvalidArgumentError
from evonav.sensors.observation import MapFrame

if TYPE_CHECKING:
    from evonav.memory.objects import ObjectEntry, ObjectMap
    from evonav.memory.occupancy import OccupancyMap


@dataclass(frozen=True, slots=True)
class RoundDiagnostics:
    """The part of an explanation that is asked for in every round, as records state it."""

    choice: str = ""
    """The agent's choice, for example `object 12`, `frontier 3`, `none`."""
    chosen_entry: EntryBelief | None = None
    num_entries: int = 0
    num_frontiers: int = 0
    counters: dict[str, int] = field(default_factory=dict)
    """Cumulative counts, such as `conflicts`, `cells_cleared`, `rejected_entries`."""
    details: dict[str, Any] = field(default_factory=dict)
    """Further JSON-ready values."""
    places: PlaceBelief | None = None
    """Belief of where the target is, in a stage's first round: it is recorded and scored."""


@dataclass(frozen=True, slots=True)
class FrontierBelief:
    """A frontier in the agent's map."""

    frontier_id: int
    position_m: tuple[float, float]
    direction_rad: float


@dataclass(frozen=True, slots=True)
class MapBelief:
    """An agent's map as `evonav view` draws it."""

    cells: NDArray[np.uint8]
    """`(R, C)`: 0 unknown, 1 free, 2 blocked."""
    map_frame: MapFrame
    """Frame of `cells`; it may differ from the task's own."""
    frontiers: Sequence[FrontierBelief] = ()
    explored: NDArray[np.bool_] | None = None
    """`(R, C)`: cells that were seen from close by, if the agent distinguishes them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Explanation:
    """Answer of an agent's method `explain`: what the agent knows, and what it chose in the last round.

    The method is called after every `act`, and when a stage begins and ends. Records then contain the object entries,
    and `evonav view` draws them with the map. Nothing of it is scored, except `places` and the entries' `p_present`.
    A function in place of a value is called only where the value is needed.

    Examples:
        >>> from evonav import Agent, Explanation, ObjectMap, OccupancyMap
        >>> class Mine(Agent):
        ...     def begin_task(self, task):
        ...         self.map, self.objects = OccupancyMap(task.map_frame), ObjectMap()
        ...
        ...     def explain(self):
        ...         return Explanation(map=self.map, objects=self.objects)
    """

    map: OccupancyMap | Callable[[], MapBelief | None] | None = None
    """The agent's map, with its frontiers."""
    objects: ObjectMap | Callable[[], Sequence[EntryBelief]] | None = None
    """The agent's object memory."""
    chosen_id: int | None = None
    """Id of the entry of `objects` that the agent chose; the evaluator notes whether it was stale."""
    chosen_entry: EntryBelief | None = None
    """The entry as it was when it was chosen; default: as it is in `objects` now."""
    choice: str = ""
    """The choice in a few words; default: `object ID` if `chosen_id` is given. `frontier ID` is marked on the map."""
    reason: str = ""
    """Reason for the choice."""
    num_entries: int | None = None
    """Number of entries when the agent chose; default: those of an `ObjectMap` now, else 0."""
    num_frontiers: int | None = None
    """Number of frontiers when the agent chose; default: those of an `OccupancyMap` now, else 0."""
    counters: Mapping[str, int] = field(default_factory=dict)
    """Cumulative counts, such as `conflicts`."""
    places: PlaceBelief | Callable[[], PlaceBelief | None] | None = None
    """Belief of where the target is: `evonav view` draws it, and that of the first round is scored."""
    details: Mapping[str, Any] = field(default_factory=dict)
    """Further JSON-ready values."""
    candidate_ids: Sequence[int] = ()
    """Ids of the entries that the last question offered."""
    questions: Sequence[QueryLogEntry] = ()
    """The questions of the round with their answers."""

    def entries(self) -> list[EntryBelief]:
        """Return the object memory as records state it."""
        if self.objects is None:
            return []
        return list(self.objects()) if callable(self.objects) else [entry_belief(one) for one in self.objects.entries]

    def map_belief(self) -> MapBelief | None:
        """Return the map as it is now."""
        if self.map is None or callable(self.map):
            return None if self.map is None else self.map()
        frontiers = [FrontierBelief(one.id, one.position_m, one.direction_rad) for one in self.map.frontiers]
        return MapBelief(self.map.cells, self.map.map_frame, frontiers, self.map.explored)

    def place_belief(self) -> PlaceBelief | None:
        """Return the belief of where the target is."""
        return self.places() if callable(self.places) else self.places

    def diagnostics(self, *, is_first: bool) -> RoundDiagnostics:
        """Return what records state of the round, which may be the first of a stage."""
        objects = None if callable(self.objects) else self.objects
        num_frontiers = self.num_frontiers
        if num_frontiers is None:
            num_frontiers = 0 if self.map is None or callable(self.map) else len(self.map.frontiers)
        chosen = self.chosen_entry
        if chosen is None and objects is not None and self.chosen_id is not None:
            found = objects.entry(self.chosen_id)
            chosen = None if found is None else entry_belief(found)
        num_entries = 0 if objects is None else len(objects)
        return RoundDiagnostics(
            choice=self.choice or ("" if self.chosen_id is None else f"object {self.chosen_id}"),
            chosen_entry=chosen,
            num_entries=num_entries if self.num_entries is None else self.num_entries,
            num_frontiers=num_frontiers,
            counters=dict(self.counters),
            details={"reason": self.reason, **self.details} if self.reason else dict(self.details),
            places=self.place_belief() if is_first else None,
        )


def explains(agent: object) -> bool:
    """Return whether an agent has a method `explain`."""
    return callable(getattr(agent, "explain", None))


def explanation_of(agent: Any) -> Explanation:  # noqa: ANN401 - any class may be an agent
    """Return the explanation of an agent that `explains`; `InvalidArgumentError` if the method returns another type."""
    found = agent.explain()
    if not isinstance(found, Explanation):
        raise InvalidArgumentError(f"explain = {str(found)[:100]!r}: must be an evonav.Explanation")
    return found


@lru_cache(maxsize=1024)  # an entry that has not changed is the same object as before
def entry_belief(entry: ObjectEntry) -> EntryBelief:
    """Return an entry of an `ObjectMap` as records state it."""
    return EntryBelief(entry.id, entry.label, entry.centre_m, entry.size_m, entry.num_detections)
