"""Fail-then-Update that looks once more, from another side, where its look on arrival does not tell."""

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from evonav.agents.agent import AgentAction
from evonav.agents.frontier_update.fail_then_update import FailThenUpdate, FailThenUpdateConfig
from evonav.agents.navigator import NavigationTarget, Navigator
from evonav.agents.viewpoint import window_around
from evonav.decision.pictures import Picture
from evonav.memory.objects import ObjectEntry
from evonav.memory.occupancy import FREE
from evonav.memory.presence import Presence
from evonav.points import Point2
from evonav.sensors.observation import MapFrame, Observation, View
from evonav.tasks.public import Goal
from evonav.world.pose import Pose


@dataclass(frozen=True, slots=True)
class RelookConfig(FailThenUpdateConfig):
    """Fail-then-Update's values, and conditions for the place of a second look; all are ours."""

    min_turn_deg: float = 60.0
    """Smallest angle around the object between the places of the first and the second look."""
    max_way_m: float = 5.0
    """Longest way from the first place to the second, over floor that is known to be free."""


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
        min_turn_rad=math.radians(config.min_turn_deg),
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


def places_around(
    is_free: NDArray[np.bool_],
    frame: MapFrame,
    object_m: Point2,
    first_m: Point2,
    *,
    distance_m: float,
    min_turn_rad: float,
    num_directions: int = 24,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return free places around an object on other sides of it than a first place.

    Args:
        is_free: `(R, C)`, cells known to be free.
        distance_m: Wanted distance from the object. Places may be up to two cells farther away.
        min_turn_rad: Smallest angle at the object between the first place and another.
        num_directions: Number of directions around the object. For each on another side, the free cell nearest to the
            point at `distance_m` counts.

    Returns:
        `(N, 2)` middles of cells, `(x, z)`, without repetitions, by row and column; `(N,)` angles at the object between
        them and the first place, radians, 0 to pi.
    """
    max_distance_m = distance_m + 2 * frame.cell_m
    window, offset = window_around(is_free, frame, object_m, max_distance_m)
    x_m, z_m = (frame.centres_m(np.argwhere(window) + offset) - object_m).T
    min_turn_rad -= 1e-9  # the least angle itself counts, however it is rounded
    first_rad = math.atan2(first_m[0] - object_m[0], first_m[1] - object_m[1])
    turns_rad = _angles_between(np.arctan2(x_m, z_m), first_rad)
    is_on_other_side = (turns_rad >= min_turn_rad) & (np.hypot(x_m, z_m) <= max_distance_m)
    x_m, z_m, turns_rad = x_m[is_on_other_side], z_m[is_on_other_side], turns_rad[is_on_other_side]
    if len(x_m) == 0:
        return np.empty((0, 2)), np.empty(0)
    bearings_rad = np.arange(num_directions) * (math.tau / num_directions)
    bearings_rad = bearings_rad[_angles_between(bearings_rad, first_rad) >= min_turn_rad]
    wanted_x_m, wanted_z_m = distance_m * np.sin(bearings_rad), distance_m * np.cos(bearings_rad)
    gaps_m = np.hypot(x_m[:, None] - wanted_x_m, z_m[:, None] - wanted_z_m)
    chosen = np.flatnonzero(np.bincount(gaps_m.argmin(axis=0)))  # `np.unique` imports 15 ms of masked arrays
    return np.stack([x_m[chosen] + object_m[0], z_m[chosen] + object_m[1]], axis=1), turns_rad[chosen]


def _angles_between(bearings_rad: NDArray[np.floating[Any]], other_rad: float) -> NDArray[np.float64]:
    """Return the angles between bearings and another one, 0 to pi."""
    angles_rad: NDArray[np.float64] = np.abs((bearings_rad - other_rad + math.pi) % math.tau - math.pi)
    return angles_rad


class FailThenUpdateRelook(FailThenUpdate):
    """Asks after a second look where neither detections nor depth of the first tell; once an entry and stage."""

    config: RelookConfig = RelookConfig()
    _counted: ClassVar[tuple[str, ...]] = (
        *FailThenUpdate._counted,
        *("relooks", "relooks_yes", "relooks_no", "relooks_unknown", "relooks_without_place"),
    )

    def begin_stage(self, goal: Goal) -> None:
        """Take a new goal."""
        super().begin_stage(goal)
        self._first_looks: list[FirstLook] = []
        """Looks of this stage that told nothing and led to a second one."""

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
        config = self.config
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
