"""Frontier-Update that explores by a rule of its own, and the rule of VLFM and OneMap: places by value.

The question offers the one place that the rule chooses.
"""

import math
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

from evonav.agents.agent import AgentAction, NavigateTo
from evonav.agents.frontier_update.agent import FrontierUpdate
from evonav.agents.rivals.relatedness import Relatedness
from evonav.decision.candidates import FrontierCandidate
from evonav.memory import Frontier
from evonav.points import Point2
from evonav.sensors.observation import Observation

SAME_M = 0.5
"""A place this near the last one stands for it if the last one is gone (VLFM, OneMap)."""
MARGIN = 0.01
"""The last place is kept while its value plus this is above the value for which it was chosen (VLFM, OneMap)."""


@dataclass(frozen=True, slots=True)
class Place:
    """A place to explore."""

    position_m: Point2
    """Place to stand."""
    face_m: Point2
    """Point to look at from there."""
    value: float
    frontier: Frontier | None = None
    """The frontier, if the place is one."""


class OwnExploration(FrontierUpdate):
    """Asks whether a remembered object is the goal; where it goes otherwise is its own rule, not the model's choice.

    So agents with other rules of exploration have the same decisions.
    """

    _place: Place | None = None
    """The place that the last question offered."""

    def act(self, observation: Observation) -> AgentAction:
        """Act as Frontier-Update does, with what labels have to do with the goal at hand."""
        self._related = Relatedness(self._matcher, self._matcher.parsed(self._goal), self._goal_feature(observation))
        return super().act(observation)

    @abstractmethod
    def _place_to_explore(self, observation: Observation) -> Place | None:
        """Return where the rule would explore now; `None` if nothing is left."""

    def _goes_to(self, place: Place, here: Point2) -> None:
        """Note that the agent, at `here`, goes to a place that the rule chose."""

    def _places_to_explore(self, observation: Observation) -> Sequence[FrontierCandidate]:
        place = self._place = self._place_to_explore(observation)
        if place is None:
            return []
        self._here = (observation.pose.x_m, observation.pose.z_m)
        image = self._navigator.image_towards(place.face_m) if self._shows_images else None
        frontier_id = -1 if place.frontier is None else place.frontier.id
        return [FrontierCandidate(frontier_id, place.position_m, math.dist(place.position_m, self._here), image)]

    def _explore(self, place: FrontierCandidate, reason: str) -> AgentAction:
        chosen = self._place
        assert chosen is not None, "the question offered it"
        self._goes_to(chosen, self._here)
        reason = f"value {chosen.value:.2f}: {reason}"
        if chosen.frontier is not None:
            return self._go_to_frontier(chosen.frontier, reason)
        self._navigator.explorer.stop_exploring()
        self._record_round("search", reason)
        is_elsewhere = math.dist(chosen.face_m, chosen.position_m) > 1e-6
        return NavigateTo(chosen.position_m, face_m=chosen.face_m if is_elsewhere else None)


class Pursuit:
    """Keeps to the last place while its value does not fall, and never makes the same choice twice.

    A choice is the place of the agent, the place chosen, and the two largest values.
    """

    def __init__(self) -> None:
        self._last: Place | None = None
        self._made: set[tuple[object, ...]] = set()

    def choice(self, places: Sequence[Place], here_m: Point2) -> Place | None:
        """Return the place to go to: the last one, else the one with the largest value that was not chosen before.

        Returns:
            Of equal values the nearest; if all were chosen before, the nearest; `None` without places.
        """
        if not places:
            return None
        last = self._last
        if last is not None:
            near = min(places, key=lambda place: math.dist(place.position_m, last.position_m))
            if math.dist(near.position_m, last.position_m) <= SAME_M and near.value + MARGIN > last.value:
                return near
        ranked = sorted(places, key=lambda place: (-place.value, math.dist(place.position_m, here_m)))
        new = (place for place in ranked if _state(place, ranked, here_m) not in self._made)
        return next(new, None) or min(places, key=lambda place: math.dist(place.position_m, here_m))

    def go(self, place: Place, places: Sequence[Place], here_m: Point2) -> None:
        """Note that the agent goes to a place; `places` are those among which it was chosen."""
        ranked = sorted(places, key=lambda one: -one.value)
        self._made.add(_state(place, ranked, here_m))
        self._last = place

    def is_going_to(self, place: Place) -> bool:
        """Return whether the agent last went to this place."""
        return self._last is not None and math.dist(place.position_m, self._last.position_m) <= SAME_M


def _state(place: Place, ranked: Sequence[Place], here_m: Point2) -> tuple[object, ...]:
    x_m, z_m = here_m
    return (round(x_m, 1), round(z_m, 1)), place.position_m, (ranked[0].value, ranked[min(1, len(ranked) - 1)].value)
