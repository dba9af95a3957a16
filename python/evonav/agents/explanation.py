"""Let an agent explain itself by handing over its map and its object memory."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from evonav.agents.agent import (
    Belief,
    EntryBelief,
    ExplainingAgent,
    FrontierBelief,
    InspectableAgent,
    PlaceBelief,
    RoundDiagnostics,
)
from evonav.sensors.observation import MapFrame

if TYPE_CHECKING:
    from evonav.memory.objects import ObjectEntry, ObjectMap
    from evonav.memory.occupancy import OccupancyMap

_NO_MAP = MapFrame(rows=1, cols=1, cell_m=0.05, corner_m=(0.0, 0.0))


@dataclass(frozen=True, slots=True, kw_only=True)
class Explanation:
    """Answer of an agent's method `explain`, which is called after every `act`: what the agent knows and chose.

    Records then contain the object entries, and `evonav view` draws them with the map. Nothing of it is scored.

    Examples:
        >>> from evonav import Agent, Explanation, ObjectMap, OccupancyMap
        >>> class Mine(Agent):
        ...     def begin_task(self, task):
        ...         self.map, self.objects = OccupancyMap(task.map_frame), ObjectMap()
        ...
        ...     def explain(self):
        ...         return Explanation(map=self.map, objects=self.objects)
    """

    map: OccupancyMap | None = None
    """The agent's map, with its frontiers."""
    objects: ObjectMap | None = None
    """The agent's object memory."""
    chosen_id: int | None = None
    """Id of the entry of `objects` that the agent chose; the evaluator notes whether it was stale."""
    choice: str = ""
    """The choice in a few words; default: `object ID` if `chosen_id` is given. `frontier ID` is marked on the map."""
    reason: str = ""
    """Reason for the choice."""
    counters: Mapping[str, int] = field(default_factory=dict)
    """Cumulative counts, such as `conflicts`."""
    places: PlaceBelief | None = None
    """Belief of where the target is: `evonav view` draws it, and that of the first round is scored."""
    details: Mapping[str, Any] = field(default_factory=dict)
    """Further JSON-ready values."""


class _HasExplanation(Protocol):
    def explain(self) -> Explanation: ...


def explaining(agent: object) -> ExplainingAgent | None:
    """Return an agent's diagnostics and entries: its own methods, or made from `explain`; `None` if it has neither."""
    return agent if isinstance(agent, ExplainingAgent) else _from_explain(agent)


def inspectable(agent: object) -> InspectableAgent | None:
    """Return an agent's belief: its own method, or made from `explain`; `None` if it has neither."""
    return agent if isinstance(agent, InspectableAgent) else _from_explain(agent)


@lru_cache(maxsize=1024)  # an entry that has not changed is the same object as before
def entry_belief(entry: ObjectEntry) -> EntryBelief:
    """Return an entry of an `ObjectMap` as records state it."""
    return EntryBelief(entry.id, entry.label, entry.centre_m, entry.size_m, entry.num_detections)


def frontier_beliefs(occupancy: OccupancyMap) -> list[FrontierBelief]:
    """Return the frontiers of a map as pages show them."""
    return [FrontierBelief(f.id, f.position_m, f.direction_rad) for f in occupancy.frontiers]


def _from_explain(agent: Any) -> _ExplainAdapter | None:  # noqa: ANN401 - any class may be an agent
    return _ExplainAdapter(agent) if callable(getattr(agent, "explain", None)) else None


class _ExplainAdapter:
    """Diagnostics, entries and belief of an agent with a method `explain`."""

    def __init__(self, agent: _HasExplanation) -> None:
        self._agent = agent

    def diagnostics(self) -> RoundDiagnostics:
        """Return what the agent chose in the last round, and its counters."""
        found = self._agent.explain()
        chosen = None if found.objects is None or found.chosen_id is None else found.objects.entry(found.chosen_id)
        return RoundDiagnostics(
            choice=found.choice or ("" if found.chosen_id is None else f"object {found.chosen_id}"),
            chosen_entry=None if chosen is None else entry_belief(chosen),
            num_entries=0 if found.objects is None else len(found.objects),
            num_frontiers=0 if found.map is None else len(found.map.frontiers),
            counters=dict(found.counters),
            places=found.places,
            details={"reason": found.reason, **found.details} if found.reason else dict(found.details),
        )

    def entries(self) -> Sequence[EntryBelief]:
        """Return the object memory."""
        objects = self._agent.explain().objects
        return [] if objects is None else [entry_belief(entry) for entry in objects.entries]

    def belief(self) -> Belief:
        """Return entries, map and frontiers; the questions of the agent are not known."""
        found = self._agent.explain()
        return Belief(
            entries=self.entries(),
            candidate_ids=(),
            frontiers=[] if found.map is None else frontier_beliefs(found.map),
            cells=np.zeros((1, 1), np.uint8) if found.map is None else found.map.cells,
            map_frame=_NO_MAP if found.map is None else found.map.map_frame,
            queries=(),
            explored=None if found.map is None else found.map.explored,
            places=found.places,
        )
