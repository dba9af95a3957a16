"""Find where to look at a remembered object a second time, from another side."""

import math
from dataclasses import dataclass

import numpy as np

from evonav.agents.navigator import Navigator
from evonav.agents.viewpoint import places_around
from evonav.decision.pictures import Picture
from evonav.memory.objects import ObjectEntry
from evonav.memory.occupancy import FREE
from evonav.records import Point2
from evonav.sensors.observation import View
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
