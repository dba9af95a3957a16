"""OneMap (Busch et al., ICRA 2025): one map of what all cells show, kept over goals, and looked at again by each."""

import math
from dataclasses import dataclass, field

import numpy as np

from evonav.agents.agent import AgentAction
from evonav.agents.explorer import AS_THREE_D_MEM_PLUS
from evonav.agents.frontier_update.agent import FrontierUpdateConfig
from evonav.agents.frontier_update.own_exploration import OwnExploration, Place
from evonav.agents.navigator import Navigator, NavigatorConfig
from evonav.agents.relatedness import Relatedness
from evonav.agents.value_maps.label_map import LabelMap, LabelMapConfig, clusters_of
from evonav.agents.value_maps.pursuit import SAME_M, Pursuit
from evonav.decision.question import DecisionModel
from evonav.memory import Frontier
from evonav.memory.objects import ObjectMap, ObjectUpdate
from evonav.points import Point2
from evonav.sensors.observation import Observation, View
from evonav.tasks.public import Goal


@dataclass(frozen=True, slots=True)
class OneMapConfig(FrontierUpdateConfig):
    """OneMap's constants."""

    navigator: NavigatorConfig = field(default_factory=lambda: NavigatorConfig(explorer=AS_THREE_D_MEM_PLUS))
    labels: LabelMapConfig = field(default_factory=LabelMapConfig)
    cluster_share: float = 0.8
    """Cells of a cluster have at least this share of the largest similarity."""
    min_cluster_cells: int = 2
    """Smallest number of cells of a cluster."""
    frontier_margin_m: float = 0.5
    """Unexplored cells this near a frontier's region count for its value; ours."""


class OneMap(OwnExploration):
    """Explores the frontier or the unchecked place with the largest similarity to the goal."""

    def __init__(self, config: OneMapConfig | None = None, decision: DecisionModel | None = None) -> None:
        self._own = config or OneMapConfig()
        super().__init__(self._own, decision)

    def _new_navigator(self) -> Navigator:
        navigator = super()._new_navigator()
        self._labels = LabelMap(self._task.map_frame, self._own.labels)
        navigator.observers.append(self._see)
        return navigator

    def begin_stage(self, goal: Goal) -> None:
        """Take a new goal: nothing is checked for it yet."""
        super().begin_stage(goal)
        self._labels.begin_goal()
        self._pursuit = Pursuit()
        self._looked_at: list[Point2] = []
        """Clusters of this stage that the agent went to see."""

    def act(self, observation: Observation) -> AgentAction:
        """Look, take in what cells show, and act as Frontier-Update does."""
        feature = observation.goal_feature if self._goal_input != "image" else None
        self._related = Relatedness(self._matcher, self._matcher.parsed(self._goal), feature)
        return super().act(observation)

    def _see(self, objects: ObjectMap, view: View, update: ObjectUpdate) -> None:
        self._labels.see(view)

    def _after_look(self, observation: Observation) -> None:
        place = self._place
        is_done = observation.has_arrived or not observation.is_action_success
        if place is not None and place.frontier is None and is_done and self._pursuit.is_going_to(place):
            self._looked_at.append(place.face_m)

    def _place_to_explore(self, observation: Observation) -> Place | None:
        self._places = self._all_places()
        return self._pursuit.choice(self._places, (observation.pose.x_m, observation.pose.z_m))

    def _all_places(self) -> list[Place]:
        """Return all frontiers, and the clusters of similar cells that were not checked for this goal."""
        config, labels, frame = self._own, self._labels, self._task.map_frame
        similarity, explored = labels.similarity(self._related), labels.explored
        beyond = np.where(explored, 0.0, similarity)
        places = [
            Place(one.position_m, one.position_m, self._value_beyond(one, beyond), one)
            for one in self._navigator.explorer.frontiers
        ]
        is_open = explored & ~labels.checked
        for row, col, value in clusters_of(
            similarity, is_open, share=config.cluster_share, min_cells=config.min_cluster_cells
        ):
            middle_m = frame.centre_m(row, col)
            stand_m = self._navigator.observation_point(middle_m)
            if stand_m is not None and all(math.dist(middle_m, one) > SAME_M for one in self._looked_at):
                places.append(Place(stand_m, middle_m, value))
        return places

    def _value_beyond(self, frontier: Frontier, beyond: np.ndarray) -> float:
        """Return the largest similarity of the unexplored cells in and around a frontier's region."""
        margin = round(self._own.frontier_margin_m / self._task.map_frame.cell_m)
        lows, highs = frontier.cells.min(axis=0) - margin, frontier.cells.max(axis=0) + margin + 1
        low_row, low_col = np.maximum(lows, 0).tolist()
        high_row, high_col = highs.tolist()
        return float(beyond[low_row:high_row, low_col:high_col].max(initial=0.0))

    def _goes_to(self, place: Place, here: Point2) -> None:
        self._pursuit.go(place, self._places, here)
