"""The agent contract: what evonav evaluates, and every answer that an agent may give."""

from dataclasses import dataclass, field
from typing import Literal, Protocol

from evonav.points import Point2, Point3, Real
from evonav.sensors.observation import Observation
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
    kind: Literal["move"] = field(default="move", kw_only=True, repr=False)
    """The name of this type of answer in files, as in all answers."""


@dataclass(frozen=True, slots=True)
class NavigateTo:
    """Go towards a point along planner waypoints, at most `SensorConfig.max_travel_m` this round.

    Examples:
        >>> import evonav
        >>> evonav.NavigateTo((3.5, 2.0))
        NavigateTo(position_m=(3.5, 2.0), face_m=None)
    """

    position_m: Point2
    """`(x, z)`; snapped to the nearest free point."""
    face_m: Point2 | None = None
    """`(x, z)` to face on arrival; default: the direction of travel."""
    kind: Literal["navigate_to"] = field(default="navigate_to", kw_only=True, repr=False)


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
    kind: Literal["stop"] = field(default="stop", kw_only=True, repr=False)


AgentAction = Move | NavigateTo | Stop


@dataclass(frozen=True, slots=True)
class ViewSchedule:
    """Views of a round: `count` cameras, `spacing_deg` apart, centred on the heading; the heading view comes last."""

    count: int
    spacing_deg: Real


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
    max_travel_m: Real = 1.0
    """Path length that a `NavigateTo` covers in one round."""
    occupancy_range_m: Real = 3.0


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
    centre_m: Point3
    size_m: Point3
    """Edge lengths of the axis-aligned box."""
    num_detections: int
    p_present: Real | None = None
    """Probability that the object is still there, 0 to 1, if the agent has one: it is scored as a stage begins."""


@dataclass(frozen=True, slots=True)
class PlaceBelief:
    """An agent's belief of where the target is: probabilities of squares on the floor.

    What their sum lacks of 1 is the probability of all other places.

    Examples:
        >>> import evonav
        >>> belief = evonav.PlaceBelief(cell_m=0.5, centres_m=((1.25, 2.75), (1.75, 2.75)), probabilities=(0.6, 0.3))
    """

    cell_m: Real
    """Edge of the squares."""
    centres_m: tuple[Point2, ...]
    """Middles of the squares, `(x, z)`."""
    probabilities: tuple[Real, ...]
    """Probability of each square, 0 to 1."""
