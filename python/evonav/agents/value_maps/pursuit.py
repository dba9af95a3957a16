"""Choose among places by value: VLFM's rule, which OneMap shares."""

import math
from collections.abc import Sequence

from evonav.agents.frontier_update.own_exploration import Place
from evonav.points import Point2

SAME_M = 0.5
"""A place this near the last one stands for it if the last one is gone (VLFM, OneMap)."""
MARGIN = 0.01
"""The last place is kept while its value plus this is above the value for which it was chosen (VLFM, OneMap)."""

_State = tuple[Point2, Point2, tuple[float, float]]


class Pursuit:
    """Keeps to the last place while its value does not fall, and never makes the same choice twice.

    A choice is the place of the agent, the place chosen, and the two largest values.
    """

    def __init__(self) -> None:
        self._last: Place | None = None
        self._made: set[_State] = set()

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


def _state(place: Place, ranked: Sequence[Place], here_m: Point2) -> _State:
    x_m, z_m = here_m
    return (round(x_m, 1), round(z_m, 1)), place.position_m, (ranked[0].value, ranked[min(1, len(ranked) - 1)].value)
