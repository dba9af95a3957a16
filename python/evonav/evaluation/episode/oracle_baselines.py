"""Hold the oracle baselines, which know more than an agent may, and so bound the scores that agents can reach.

Only the classes of `ORACLE_BASELINES` receive oracle data. A plug-in receives none, even if it has methods of the same
names or inherits from `OracleBaseline`.
"""

import math
from collections.abc import Sequence

from evonav.agents.agent import AgentAction, NavigateTo, Stop
from evonav.agents.baselines import NearestFrontier
from evonav.agents.explanation import Explanation
from evonav.agents.frontier_update.agent import FrontierUpdate
from evonav.agents.registry import new_agent
from evonav.decision.question import DecisionModel
from evonav.errors import InvalidArgumentError
from evonav.evaluation.baselines import ORACLE_BASELINE_NAMES
from evonav.evaluation.episode.oracle_baseline import STOP_DISTANCE_M, OracleBaseline, Sighting
from evonav.sensors.observation import Observation
from evonav.tasks.public import Goal, TaskInfo


class ShortestPath(OracleBaseline):
    """Walks the planner's path to the target: SR and SPL are 1 by construction, or the harness is wrong."""

    description = "the planner's path to the target, SR = SPL = 1 by construction"

    def act(self, observation: Observation) -> AgentAction:
        """Follow the path until the target is near."""
        return self._go_to_target(observation)


class PerfectRecognition(OracleBaseline):
    """Nearest-frontier exploration that recognises the target instance at first sight: what search alone can reach."""

    description = "nearest-frontier exploration that recognises the target at first sight"

    def __init__(self) -> None:
        super().__init__()
        self._explorer = NearestFrontier()
        self.sensors = self._explorer.sensors
        self._has_seen_target = False

    def begin_task(self, task: TaskInfo) -> None:
        """Forget the map."""
        self._explorer.begin_task(task)

    def begin_stage(self, goal: Goal) -> None:
        """Begin with a new target, not yet seen; the map stays."""
        self._explorer.begin_stage(goal)
        self._has_seen_target = False

    def act(self, observation: Observation) -> AgentAction:
        """Explore until the target has been in view, then go there."""
        action = self._explorer.act(observation)
        if self._is_target_visible and not self._has_seen_target:
            self._has_seen_target = True
            return self._go_from_anywhere(observation)
        return self._go_to_target(observation) if self._has_seen_target else action

    def _go_from_anywhere(self, observation: Observation) -> AgentAction:
        # `has_arrived` still speaks of the last frontier.
        pose = observation.pose
        is_near = math.dist((pose.x_m, pose.z_m), self._target_m) <= STOP_DISTANCE_M
        return Stop() if is_near else NavigateTo(self._target_m)

    def explain(self) -> Explanation:
        """Return the explorer's choice."""
        return self._explorer.explain()


class OracleMemory(PerfectRecognition):
    """The same with a perfect memory: it knows where everything that it has seen in the episode stands now."""

    description = "the same, and goes at once to what it has seen in an earlier stage, wherever that stands now"

    def reveal_sighting(self, sighting: Sighting) -> None:
        """Receive the sighting; a target that was seen counts as in view."""
        super().reveal_sighting(
            Sighting(sighting.is_target_visible or sighting.is_target_seen, sighting.is_target_seen)
        )


class OracleFlags(FrontierUpdate, OracleBaseline):
    """Frontier-Update that knows, as a stage begins, which of its entries the change has made stale."""

    description = "Frontier-Update whose stale entries are taken out as a stage begins"

    def __init__(self, decision: DecisionModel | None = None) -> None:
        OracleBaseline.__init__(self)
        FrontierUpdate.__init__(self, decision=decision)

    def reveal_stale(self, entry_ids: Sequence[int]) -> None:
        """Forget these entries."""
        for entry_id in entry_ids:
            self._navigator.objects.remove(entry_id)


ORACLE_BASELINES: dict[str, type[OracleBaseline]] = dict(
    zip(ORACLE_BASELINE_NAMES, (ShortestPath, PerfectRecognition, OracleMemory, OracleFlags), strict=True)
)
"""The oracle baselines by name, for `evonav evaluate --agent`."""


def new_oracle_baseline(name: str, decision: DecisionModel | None = None) -> OracleBaseline:
    """Make an oracle baseline.

    Args:
        decision: Handed to one that takes one; default: its own.

    Raises:
        InvalidArgumentError: There is none of this name.
    """
    if name not in ORACLE_BASELINES:
        raise InvalidArgumentError(f"no oracle baseline `{name}`; there are {', '.join(sorted(ORACLE_BASELINES))}")
    made = new_agent(ORACLE_BASELINES[name], decision)
    assert isinstance(made, OracleBaseline)
    return made
