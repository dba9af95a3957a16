"""Wrap an agent, and record its calls, errors and answers."""

import hashlib
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from evonav.agents.agent import Agent, AgentAction, EntryBelief, SensorConfig
from evonav.agents.explanation import Explanation, explains, explanation_of
from evonav.agents.hosting import wire
from evonav.sensors.observation import MapFrame, Observation
from evonav.tasks.public import Goal, TaskInfo

T = TypeVar("T")

MAP_MARGIN_M = 0.5
"""Distance that an entry may lie outside the map, as walls and objects on them do."""


class Probe:
    """An agent whose calls are recorded."""

    def __init__(self, agent: Agent) -> None:
        """Wrap an agent."""
        self.agent = agent
        self.explains = explains(agent)
        self.calls = {"begin_task": 0, "begin_stage": 0, "act": 0, "explain": 0, "diagnostics": 0, "entries": 0}
        self.errors: dict[str, BaseException] = {}
        self.seconds: list[float] = []
        self.largest_diagnostics = 0
        self.num_entries = 0
        self.outside: list[str] = []
        self._frame: MapFrame | None = None
        self._given: list[tuple[str, NDArray[Any], str]] = []
        self._changed = ""

    @property
    def sensors(self) -> SensorConfig:
        """The sensors that the agent needs."""
        return self.agent.sensors

    @sensors.setter
    def sensors(self, sensors: SensorConfig) -> None:
        self.agent.sensors = sensors

    def begin_task(self, task: TaskInfo) -> None:
        """Begin a task."""
        self._frame = task.map_frame
        self._call("begin_task", lambda: self.agent.begin_task(task))

    def begin_stage(self, goal: Goal) -> None:
        """Begin a stage."""
        self._note("reference_image", goal.reference_image)
        self._call("begin_stage", lambda: self.agent.begin_stage(goal))

    def act(self, observation: Observation) -> AgentAction:
        """Run a decision round, and measure its time."""
        for view in observation.views:
            self._note("depth_m", view.depth_m)
            self._note("detections.masks", view.detections.masks)
            self._note("occupancy.free", view.occupancy.free)
            self._note("occupancy.blocked", view.occupancy.blocked)
            if view.rgb is not None:
                self._note("rgb", view.rgb)
        began_s = time.perf_counter()
        action = self._call("act", lambda: self.agent.act(observation))
        self.seconds.append(time.perf_counter() - began_s)
        return action

    def explain(self) -> Explanation:
        """Return the agent's explanation; what is recorded of a round is checked as it is after JSON."""
        if not self.explains:
            return Explanation()
        found = self._call("explain", lambda: explanation_of(self.agent))
        if self.calls["act"] == 0:
            return replace(found, objects=lambda: self._noted(found))
        text = self._call("diagnostics", lambda: wire.DIAGNOSTICS.write(found.diagnostics(is_first=True)))
        self.largest_diagnostics = max(self.largest_diagnostics, len(text))
        said = self._call("diagnostics", lambda: wire.DIAGNOSTICS.read(text))
        return replace(
            found,
            objects=lambda: self._noted(found),
            chosen_entry=said.chosen_entry,
            num_entries=said.num_entries,
        )

    def _noted(self, found: Explanation) -> Sequence[EntryBelief]:
        """Return the agent's object memory as it is after JSON."""
        entries = self._call("entries", lambda: wire.ENTRIES.read(wire.ENTRIES.write(found.entries())))
        self.num_entries += len(entries)
        self.outside += [problem for entry in entries if (problem := self._misplaced(entry)) is not None]
        return entries

    def changed(self) -> str:
        """Return the names of the arrays that the agent changed."""
        for name, array, digest in self._given:
            if _digest(array) != digest:
                self._changed = self._changed or name
        self._given.clear()
        return self._changed

    def _note(self, name: str, array: NDArray[Any]) -> None:
        self._given.append((name, array, _digest(array)))

    def _misplaced(self, entry: EntryBelief) -> str | None:
        """Describe an entry outside the map."""
        frame = self._frame
        if frame is None:
            return None
        low = np.array(frame.corner_m) - MAP_MARGIN_M
        high = np.array(frame.corner_m) + np.array([frame.cols, frame.rows]) * frame.cell_m + MAP_MARGIN_M
        place = np.array([entry.centre_m[0], entry.centre_m[2]])
        if np.isfinite(entry.centre_m).all() and (low <= place).all() and (place <= high).all():
            return None
        return f"entry {entry.entry_id} ({entry.label}) is at {entry.centre_m}, outside the map"

    def _call(self, name: str, function: Callable[[], T]) -> T:
        """Call the agent, and record its first error."""
        self.calls[name] += 1
        try:
            return function()
        except BaseException as error:
            self.errors.setdefault(name, error)
            if isinstance(error, Exception):
                raise
            raise RuntimeError(f"{type(error).__name__} ends the process") from error


def _digest(array: NDArray[Any]) -> str:
    return hashlib.sha256(np.ascontiguousarray(array).tobytes()).hexdigest()
