"""The agent contract: what evonav evaluates, and every answer that an agent may give."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from evonav.decision.query import QueryLogEntry
from evonav.sensors.observation import MapFrame, Observation
from evonav.tasks.public import Goal, TaskInfo
from evonav.world.simulator import Action


@dataclass(frozen=True, slots=True)
class Move:
    """One discrete action.

    Examples:
        >>> import evonav
        >>> evonav.Move(evonav.Action.TURN_LEFT)
        Move(action=<Action.TURN_LEFT: 'TURN_LEFT'>)
    """

    action: Action


@dataclass(frozen=True, slots=True)
class NavigateTo:
    """Go towards a point along planner waypoints, at most `SensorConfig.max_travel_m` this round.

    Examples:
        >>> import evonav
        >>> evonav.NavigateTo((3.5, 2.0))
        NavigateTo(position_m=(3.5, 2.0), face_m=None)
    """

    position_m: tuple[float, float]
    """`(x, z)`; snapped to the nearest free point."""
    face_m: tuple[float, float] | None = None
    """`(x, z)` to face on arrival; default: the direction of travel."""


@dataclass(frozen=True, slots=True)
class Stop:
    """End the stage here.

    Examples:
        >>> import evonav
        >>> evonav.Stop("nothing left to explore")
        Stop(reason='nothing left to explore')
    """

    reason: str = "arrived"
    """`arrived`, or why the agent gave up; recorded, not scored."""


AgentAction = Move | NavigateTo | Stop


@dataclass(frozen=True, slots=True)
class ViewSchedule:
    """Views of a round: `count` cameras, `spacing_deg` apart, centred on the heading; the heading view comes last."""

    count: int
    spacing_deg: float


@dataclass(frozen=True, slots=True)
class SensorConfig:
    """The sensors that an agent needs (default: 3D-Mem's schedule), within the limits of `ProtocolConfig`.

    Examples:
        >>> import evonav
        >>> sensors = evonav.SensorConfig(needs_rgb=True)
        >>> sensors.first_round
        ViewSchedule(count=7, spacing_deg=40.0)
    """

    first_round: ViewSchedule = ViewSchedule(7, 40.0)
    later_rounds: ViewSchedule = ViewSchedule(3, 60.0)
    needs_rgb: bool = False
    motion: Literal["waypoints", "actions"] = "waypoints"
    """The unit of the stage's budget: 50 decision rounds, or 500 discrete actions (UniGoal; paper, Sec. C.3)."""
    max_travel_m: float = 1.0
    """Path length that a `NavigateTo` covers in one round."""
    occupancy_range_m: float = 3.0


class Agent(Protocol):
    """An agent as evonav evaluates it: a subclass, or any class with these methods and `sensors`.

    Examples:
        >>> import evonav
        >>> class Bold(evonav.Agent):
        ...     def begin_stage(self, goal):
        ...         self.category = goal.category
        ...
        ...     def act(self, observation):
        ...         view = observation.views[-1]
        ...         if self.category in view.detections.labels:
        ...             return evonav.Stop()
        ...         return evonav.Move(evonav.Action.TURN_LEFT)
        >>> run = evonav.evaluate(Bold, limit=1)
    """

    sensors: SensorConfig = SensorConfig()
    """The sensors that the agent needs."""

    def begin_task(self, task: TaskInfo) -> None:
        """Start in a new house and forget everything."""
        ...

    def begin_stage(self, goal: Goal) -> None:
        """Start the search for a new goal in the same house, which may have changed."""
        ...

    def act(self, observation: Observation) -> AgentAction:
        """Decide what to do in one decision round."""
        ...


@dataclass(frozen=True, slots=True)
class EntryBelief:
    """An object entry as the agent remembers it."""

    entry_id: int
    label: str
    centre_m: tuple[float, float, float]
    size_m: tuple[float, float, float]
    """Edge lengths of the axis-aligned box."""
    num_detections: int
    p_present: float | None = None
    """Probability that the object is still there, 0 to 1, if the agent has one: it is scored as a stage begins."""


@dataclass(frozen=True, slots=True)
class PlaceBelief:
    """An agent's belief of where the target is: probabilities of squares on the floor.

    What their sum lacks of 1 is the probability of all other places.

    Examples:
        >>> import evonav
        >>> belief = evonav.PlaceBelief(cell_m=0.5, centres_m=((1.25, 2.75), (1.75, 2.75)), probabilities=(0.6, 0.3))
    """

    cell_m: float
    """Edge of the squares."""
    centres_m: tuple[tuple[float, float], ...]
    """Middles of the squares, `(x, z)`."""
    probabilities: tuple[float, ...]
    """Probability of each square, 0 to 1."""


@dataclass(frozen=True, slots=True)
class RoundDiagnostics:
    """A round as the agent describes it."""

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
    """Belief of where the target is. That of a stage's first round is recorded and scored."""


@runtime_checkable
class ExplainingAgent(Protocol):
    """An agent that can report its beliefs; for records and pictures, never for scoring."""

    def diagnostics(self) -> RoundDiagnostics:
        """Return what the agent chose in the last round, and its counters."""
        ...

    def entries(self) -> Sequence[EntryBelief]:
        """Return the object memory.

        It is called when a stage begins, when it ends, and between rounds when an observed change may have changed it.
        """
        ...


@dataclass(frozen=True, slots=True)
class FrontierBelief:
    """A frontier in the agent's map."""

    frontier_id: int
    position_m: tuple[float, float]
    direction_rad: float


@dataclass(frozen=True, slots=True)
class Belief:
    """Everything that an agent believes in a round."""

    entries: Sequence[EntryBelief]
    candidate_ids: tuple[int, ...]
    """Ids of the entries that the last question offered."""
    frontiers: Sequence[FrontierBelief]
    cells: NDArray[np.uint8]
    """`(R, C)`: 0 unknown, 1 free, 2 blocked."""
    map_frame: MapFrame
    """Frame of `cells`; it may differ from the task's own."""
    queries: tuple[QueryLogEntry, ...]
    """The questions of the round with their answers."""
    explored: NDArray[np.bool_] | None = None
    """`(R, C)`: cells that were seen from close by, if the agent distinguishes them."""
    places: PlaceBelief | None = None
    """Belief of where the target is."""


@runtime_checkable
class InspectableAgent(Protocol):
    """An agent whose rounds can be inspected (`evonav view`); never used in an evaluation."""

    def belief(self) -> Belief:
        """Return what the agent believes after `act`."""
        ...
