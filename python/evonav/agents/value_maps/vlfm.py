"""VLFM (Yokoyama et al., ICRA 2024): explores the frontier with the largest value, and goes to what it detects."""

from dataclasses import dataclass, field

from evonav.agents.agent import AgentAction
from evonav.agents.explorer import AS_THREE_D_MEM_PLUS
from evonav.agents.frontier_update.agent import FrontierUpdateConfig
from evonav.agents.frontier_update.own_exploration import OwnExploration, Place
from evonav.agents.navigator import Navigator, NavigatorConfig
from evonav.agents.relatedness import Relatedness
from evonav.agents.value_maps.cone_map import ConeMap, ConeMapConfig, largest_within
from evonav.agents.value_maps.pursuit import Pursuit
from evonav.decision.question import DecisionModel
from evonav.memory.objects import ObjectMap, ObjectUpdate
from evonav.points import Point2
from evonav.sensors.observation import Observation, View
from evonav.tasks.public import Goal


@dataclass(frozen=True, slots=True)
class VlfmConfig(FrontierUpdateConfig):
    """VLFM's constants."""

    navigator: NavigatorConfig = field(default_factory=lambda: NavigatorConfig(explorer=AS_THREE_D_MEM_PLUS))
    cones: ConeMapConfig = field(default_factory=ConeMapConfig)
    value_radius_m: float = 0.5
    """A frontier has the largest value within this distance."""


class Vlfm(OwnExploration):
    """Values are of one goal, so each stage begins with a map without values; floor and objects are kept."""

    def __init__(self, config: VlfmConfig | None = None, decision: DecisionModel | None = None) -> None:
        self._own = config or VlfmConfig()
        super().__init__(self._own, decision)

    def _new_navigator(self) -> Navigator:
        navigator = super()._new_navigator()
        navigator.observers.append(self._see)
        return navigator

    def begin_stage(self, goal: Goal) -> None:
        """Take a new goal; all values are unknown."""
        super().begin_stage(goal)
        self._cones = ConeMap(self._task.map_frame, self._own.cones)
        self._pursuit = Pursuit()

    def act(self, observation: Observation) -> AgentAction:
        """Look, value what is seen, and act as Frontier-Update does."""
        feature = observation.goal_feature if self._goal_input != "image" else None
        self._related = Relatedness(self._matcher, self._matcher.parsed(self._goal), feature)
        return super().act(observation)

    def _see(self, objects: ObjectMap, view: View, update: ObjectUpdate) -> None:
        self._cones.see(view, self._related.of_view(view.detections))

    def _places(self) -> list[Place]:
        values, radius_m = self._cones.values, self._own.value_radius_m
        return [
            Place(
                one.position_m,
                one.position_m,
                largest_within(values, self._task.map_frame, one.position_m, radius_m),
                one,
            )
            for one in self._navigator.explorer.frontiers
        ]

    def _place_to_explore(self, observation: Observation) -> Place | None:
        return self._pursuit.choice(self._places(), (observation.pose.x_m, observation.pose.z_m))

    def _goes_to(self, place: Place, here: Point2) -> None:
        self._pursuit.go(place, self._places(), here)
