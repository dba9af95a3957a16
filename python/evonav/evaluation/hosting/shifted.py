"""Tell an agent shifted places, and read its answers in the house's own coordinates: the one border between both.

Stages, records, maps and measures are in the house's coordinates on this side; an agent, in whatever process, and the
model that it asks are on the other side.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from evonav.agents.agent import (
    AgentAction,
    Belief,
    EntryBelief,
    NavigateTo,
    PlaceBelief,
    RoundDiagnostics,
    SensorConfig,
)
from evonav.agents.hosting.wire import MAX_M
from evonav.errors import InvalidArgumentError
from evonav.evaluation.hosting.agent import HostedAgent
from evonav.sensors.observation import MapFrame, Observation
from evonav.tasks.public import Goal, TaskInfo
from evonav.world.pose import Pose

PLACES = ("position_m", "centre_m", "goal_m", "mid_term_m", "path_m")
"""Ends of the names of places in `RoundDiagnostics.details`."""

_Point2 = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Shift:
    """A shift of all places on the ground plane. It has no turn: see docs/reliability.md.

    Cells of `VisibleOccupancy` are counted from the corner of the map, which is shifted with them.
    """

    x_m: float
    z_m: float

    def shifted_task(self, task: TaskInfo) -> TaskInfo:
        """Return a task as the agent is told it."""
        return replace(task, map_frame=self._map_frame(task.map_frame, 1))

    def shifted_observation(self, observation: Observation) -> Observation:
        """Return an observation as the agent is told it."""
        return replace(
            observation,
            views=tuple(replace(view, pose=self._pose(view.pose)) for view in observation.views),
            pose=self._pose(observation.pose),
        )

    def unshifted_action(self, action: AgentAction) -> AgentAction:
        """Return what an agent answers, in the house's coordinates.

        Raises:
            InvalidArgumentError: A coordinate is then out of range.
        """
        if not isinstance(action, NavigateTo):
            return action
        face_m = None if action.face_m is None else self._unshifted_point(action.face_m, "action.face_m")
        return NavigateTo(self._unshifted_point(action.position_m, "action.position_m"), face_m)

    def unshifted_entry(self, entry: EntryBelief) -> EntryBelief:
        """Return an entry that an agent remembers, in the house's coordinates.

        Raises:
            InvalidArgumentError: A coordinate is then out of range.
        """
        (x_m, y_m, z_m), name = entry.centre_m, f"entry {entry.entry_id}: centre_m"
        x_m, z_m = self._unshifted_point((x_m, z_m), name)
        return replace(entry, centre_m=(x_m, y_m, z_m))

    def unshifted_diagnostics(self, diagnostics: RoundDiagnostics) -> RoundDiagnostics:
        """Return what an agent says of a round, in the house's coordinates.

        Raises:
            InvalidArgumentError: A coordinate is then out of range.
        """
        chosen = diagnostics.chosen_entry
        return replace(
            diagnostics,
            chosen_entry=None if chosen is None else self.unshifted_entry(chosen),
            places=self._unshifted_places(diagnostics.places),
            details={name: self._unshifted_detail(name, value) for name, value in diagnostics.details.items()},
        )

    def unshifted_belief(self, belief: Belief) -> Belief:
        """Return what an agent believes, in the house's coordinates; questions stay as they were asked.

        Raises:
            InvalidArgumentError: A coordinate is then out of range.
        """
        return replace(
            belief,
            entries=[self.unshifted_entry(entry) for entry in belief.entries],
            frontiers=[
                replace(frontier, position_m=self._unshifted_point(frontier.position_m, "frontier"))
                for frontier in belief.frontiers
            ],
            map_frame=self._map_frame(belief.map_frame, -1),
            places=self._unshifted_places(belief.places),
        )

    def _unshifted_places(self, places: PlaceBelief | None) -> PlaceBelief | None:
        if places is None:
            return None
        centres_m = (self._unshifted_point(centre_m, "places.centres_m") for centre_m in places.centres_m)
        return replace(places, centres_m=tuple(centres_m))

    def _pose(self, pose: Pose) -> Pose:
        return replace(pose, x_m=pose.x_m + self.x_m, z_m=pose.z_m + self.z_m)

    def _map_frame(self, frame: MapFrame, sign: int) -> MapFrame:
        x_m, z_m = frame.corner_m
        return replace(frame, corner_m=(x_m + sign * self.x_m, z_m + sign * self.z_m))

    def _unshifted_point(self, shifted_m: _Point2, name: str) -> _Point2:
        x_m, z_m = shifted_m[0] - self.x_m, shifted_m[1] - self.z_m
        if max(abs(x_m), abs(z_m)) > MAX_M:
            raise InvalidArgumentError(
                f"{name} = {shifted_m}: coordinates must be within {MAX_M:g} m of the house's own"
            )
        return x_m, z_m

    def _unshifted_detail(self, name: str, value: Any) -> Any:  # noqa: ANN401 - JSON
        if isinstance(value, dict):
            return {inner: self._unshifted_detail(inner, one) for inner, one in value.items()}
        if not isinstance(value, list):
            return value
        if not (name.endswith(PLACES) and len(value) in (2, 3) and all(map(_is_coordinate, value))):
            return [self._unshifted_detail(name, one) for one in value]
        return [value[0] - self.x_m, *value[1:-1], value[-1] - self.z_m]


def _is_coordinate(value: object) -> bool:
    """Return whether a value is a number that can be a coordinate: not infinite or NaN."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= MAX_M


class ShiftedAgent(HostedAgent):
    """An agent that is told shifted places, and answers in the house's coordinates."""

    def __init__(self, agent: HostedAgent, shift: Shift) -> None:
        """Put a shift before an agent."""
        self._agent = agent
        self._shift = shift

    @property
    def sensors(self) -> SensorConfig:
        """The sensors that the agent needs."""
        return self._agent.sensors

    @property
    def cpu_s(self) -> float:
        """CPU time that processes of its own have used."""
        return self._agent.cpu_s

    def begin_task(self, task: TaskInfo) -> None:
        """Start in a new house."""
        self._agent.begin_task(self._shift.shifted_task(task))

    def begin_stage(self, goal: Goal) -> None:
        """Start the search for a new goal, which has no places."""
        self._agent.begin_stage(goal)

    def look(self, observation: Observation, *, wants_entries: bool = False) -> None:
        """Take the observation of a decision round."""
        self._agent.look(self._shift.shifted_observation(observation), wants_entries=wants_entries)

    def act(self) -> AgentAction:
        """Decide what to do in one decision round."""
        return self._shift.unshifted_action(self._agent.act())

    def diagnostics(self) -> RoundDiagnostics:
        """Return what the agent said of the last round, right after it."""
        return self._shift.unshifted_diagnostics(self._agent.diagnostics())

    def entries(self) -> Sequence[EntryBelief] | None:
        """Return the object memory; None if the agent does not explain itself."""
        entries = self._agent.entries()
        return None if entries is None else [self._shift.unshifted_entry(entry) for entry in entries]

    def costs(self) -> Mapping[str, float]:
        """Return what its decision model has cost so far, by field of `StageCosts`; empty where that is not known."""
        return self._agent.costs()
