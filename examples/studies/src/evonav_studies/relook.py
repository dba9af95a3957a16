"""Fail-then-Update that looks once more, from another side, where its look on arrival does not tell."""

import math
from dataclasses import dataclass

import numpy as np

from evonav.agents.agent import AgentAction
from evonav.agents.frontier_update.fail_then_update import FailThenUpdate, FailThenUpdateConfig
from evonav.agents.navigator import NavigationTarget, Navigator
from evonav.agents.viewpoint import places_around
from evonav.decision.pictures import Picture
from evonav.decision.question import DecisionModel
from evonav.memory.objects import ObjectEntry
from evonav.memory.occupancy import FREE
from evonav.memory.presence import Presence
from evonav.points import Point2
from evonav.sensors.observation import Observation, View
from evonav.tasks.public import Goal, TaskInfo
from evonav.world.pose import Pose


@dataclass(frozen=True, slots=True)
class RelookConfig:
    """Conditions for the place of a second look; all are ours."""

    min_turn_deg: float = 60.0
    """Smallest angle around the object between the places of the first and the second look."""
    max_way_m: float = 5.0
    """Longest way from the first place to the second, over floor that is known to be free."""

    @property
    def min_turn_rad(self) -> float:
        """`min_turn_deg` in radians."""
        return math.radians(self.min_turn_deg)


@dataclass(frozen=True, slots=True)
class FirstLook:
    """Views at the place of an entry that did not tell whether its object is there."""

    entry_id: int
    views: tuple[View, ...]
    images: tuple[Picture, ...]
    """The same for a prompt; empty if the model does not look at images."""


@dataclass(frozen=True, slots=True)
class SecondPlace:
    """A place for a second look."""

    position_m: Point2
    way_m: float
    """Length of the way to it."""
    turn_deg: float
    """Angle around the object from the first place, 0 to 180."""


def place_from_another_side(
    navigator: Navigator, entry: ObjectEntry, first: Pose, max_way_m: float, config: RelookConfig
) -> SecondPlace | None:
    """Return the place on another side of an entry from which most of it can be seen past all remembered points.

    Args:
        navigator: The agent's map and object entries.
        first: Pose of the first look's camera, whose height is that of the second's.
        config: The other conditions.

    Returns:
        Of places that show as much, the nearest; `None` if no place shows anything. Walls are in no entry, so a place
        may be behind one.
    """
    occupancy, objects = navigator.explorer.map, navigator.objects
    points_m = objects.points_m(entry.id)
    centre_m, here_m = (entry.centre_m[0], entry.centre_m[2]), (first.x_m, first.z_m)
    places_m, turns_rad = places_around(
        occupancy.cells == FREE,
        occupancy.map_frame,
        centre_m,
        here_m,
        distance_m=navigator.config.observation_distance_m,
        min_turn_rad=config.min_turn_rad,
    )
    if points_m is None or len(places_m) == 0:
        return None
    ways_m = occupancy.distances_m(here_m, places_m)
    is_near = ways_m <= max_way_m
    places_m, turns_rad, ways_m = places_m[is_near], turns_rad[is_near], ways_m[is_near]
    shares = objects.visible_shares(points_m, np.insert(places_m, 1, first.y_m, axis=1))
    if not (shares > 0.0).any():
        return None
    best = int(np.lexsort((ways_m, -shares))[0])
    x_m, z_m = places_m[best].tolist()
    return SecondPlace((x_m, z_m), float(ways_m[best]), math.degrees(turns_rad[best]))


class FailThenUpdateRelook(FailThenUpdate):
    """Asks after a second look where neither detections nor depth of the first tell; once an entry and stage."""

    def __init__(
        self,
        config: FailThenUpdateConfig | None = None,
        decision: DecisionModel | None = None,
        *,
        relook: RelookConfig | None = None,
    ) -> None:
        super().__init__(config, decision)
        self._relook = relook or RelookConfig()
        self._first_looks: list[FirstLook] = []
        """Looks of this stage that told nothing and led to a second one."""

    def begin_task(self, task: TaskInfo) -> None:
        """Forget everything."""
        super().begin_task(task)
        self._counters.update(relooks=0, relooks_yes=0, relooks_no=0, relooks_unknown=0, relooks_without_place=0)

    def begin_stage(self, goal: Goal) -> None:
        """Take a new goal."""
        super().begin_stage(goal)
        self._first_looks.clear()

    def _act_at_place(self, entry_id: int, observation: Observation) -> AgentAction | None:
        navigator = self._navigator
        entry = navigator.objects.entry(entry_id)
        if entry is None:
            return None
        first_look = next((it for it in self._first_looks if navigator.views.resolve(it.entry_id) == entry_id), None)
        views, images = self._views_to_verify(observation), self._images_to_verify()
        if first_look is not None:
            views, images = [*first_look.views, *views], [*first_look.images, *images]
        question = self._verify_question(entry, views, images)
        presence, why = question.presence(self._matcher)
        if presence is Presence.UNKNOWN and first_look is None:
            action = self._look_again(entry, observation, why)
            if action is not None:
                return action
        stopped = self._verify(entry, question)
        if first_look is not None:
            outcome = "no" if stopped is None else "unknown" if presence is Presence.UNKNOWN else "yes"
            self._counters[f"relooks_{outcome}"] += 1
        return None if stopped is None else self._stop("verified", entry.id)

    def _look_again(self, entry: ObjectEntry, observation: Observation, why: str) -> AgentAction | None:
        """Go to another side of an entry that the first look told nothing about; `None` if there is no such place."""
        config = self._relook
        max_way_m = min(config.max_way_m, (observation.num_rounds_left - 2) * self.sensors.max_travel_m)
        views = self._views_to_verify(observation)
        place = place_from_another_side(self._navigator, entry, views[-1].pose, max_way_m, config)
        if place is None:
            self._counters["relooks_without_place"] += 1
            return None
        self._counters["relooks"] += 1
        self._first_looks.append(FirstLook(entry.id, tuple(views), tuple(self._images_to_verify())))
        self._details = {**self._details, "relooks": [look.entry_id for look in self._first_looks]}
        centre_m = (entry.centre_m[0], entry.centre_m[2])
        reason = f"a second look from {place.turn_deg:.0f} degrees around, {place.way_m:.1f} m away: {why}"
        return self._approach(NavigationTarget(entry.id, place.position_m, centre_m, keeps_place=True), reason)
