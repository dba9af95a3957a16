"""DynaMem (Liu et al., ICRA 2025): deletes every point that depth sees through, and explores what it saw long ago."""

from dataclasses import dataclass, field

from evonav.agents.agent import AgentAction
from evonav.agents.dynamem.exploration import LastSeen, SeenConfig
from evonav.agents.explorer import AS_THREE_D_MEM_PLUS
from evonav.agents.frontier_update.agent import FrontierUpdateConfig
from evonav.agents.frontier_update.own_exploration import OwnExploration, Place
from evonav.agents.navigator import Navigator, NavigatorConfig
from evonav.decision.question import DecisionModel
from evonav.memory.objects import ObjectMap, ObjectUpdate
from evonav.points import Point2
from evonav.sensors.observation import Observation, View
from evonav.tasks.public import Goal


@dataclass(frozen=True, slots=True)
class DynaMemConfig(FrontierUpdateConfig):
    """DynaMem's constants; those of its deletion are the rule `see-through`'s."""

    navigator: NavigatorConfig = field(
        default_factory=lambda: NavigatorConfig(explorer=AS_THREE_D_MEM_PLUS, forgetting="see-through")
    )
    seen: SeenConfig = field(default_factory=SeenConfig)


class DynaMem(OwnExploration):
    """Goes to a remembered object as long as its points are there; else to what it has not seen for long."""

    def __init__(self, config: DynaMemConfig | None = None, decision: DecisionModel | None = None) -> None:
        self._own = config or DynaMemConfig()
        super().__init__(self._own, decision)

    def _new_navigator(self) -> Navigator:
        navigator = super()._new_navigator()
        self._seen = LastSeen(self._task.map_frame, self._own.seen)
        navigator.observers.append(self._see)
        return navigator

    def begin_stage(self, goal: Goal) -> None:
        """Take a new goal; points and times stay."""
        super().begin_stage(goal)
        self._explored: Place | None = None

    def _see(self, objects: ObjectMap, view: View, update: ObjectUpdate) -> None:
        self._seen.see(view)

    def _after_look(self, observation: Observation) -> None:
        self._seen.be_at((observation.pose.x_m, observation.pose.z_m))
        if self._explored is not None and (observation.has_arrived or not observation.is_action_success):
            self._seen.give_up(self._explored.face_m)
            self._explored = None

    def _stops_at_sight_of_place(self) -> bool:
        return False

    def _act_at_place(self, entry_id: int, observation: Observation) -> AgentAction | None:
        """Stop if the look on arrival left the entry's points there; else decide again."""
        if self._navigator.objects.entry(entry_id) is None:
            return None
        return self._stop("verified", entry_id)

    def _place_to_explore(self, observation: Observation) -> Place | None:
        found = self._seen.best_edge(self._navigator.explorer.map, (observation.pose.x_m, observation.pose.z_m))
        return None if found is None else Place(*found)

    def _goes_to(self, place: Place, here: Point2) -> None:
        self._explored = place
