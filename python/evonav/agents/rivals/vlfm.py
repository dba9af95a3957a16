"""VLFM (Yokoyama et al., ICRA 2024): explores the frontier with the largest value, and goes to what it detects."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evonav.agents.frontier_update.agent import FrontierUpdateConfig
from evonav.agents.navigator import WITH_FALLBACK, Navigator, NavigatorConfig
from evonav.agents.rivals.exploration import OwnExploration, Place, Pursuit
from evonav.points import Point2
from evonav.sensors.observation import MapFrame, Observation, View
from evonav.tasks.public import Goal


@dataclass(frozen=True, slots=True)
class VlfmConfig(FrontierUpdateConfig):
    """VLFM's constants."""

    navigator: NavigatorConfig = WITH_FALLBACK
    min_confidence: float = 0.25
    """Confidence at the edges of the field of view; it is 1 on the axis."""
    ignored_below: float = 0.35
    """A new confidence below this does not count where it is also below the old one."""
    value_radius_m: float = 0.5
    """A frontier has the largest value within this distance."""


class ConeMap:
    """Values of the cells that views have shown, and the confidence in them."""

    def __init__(self, frame: MapFrame, config: VlfmConfig) -> None:
        self.config = config
        self._frame = frame
        self.values = np.zeros((frame.rows, frame.cols))
        self.confidences = np.zeros((frame.rows, frame.cols))

    def see(self, view: View, value: float) -> None:
        """Give all cells that a view shows its value: the mean of all views' values, weighted by confidence."""
        config = self.config
        cells = np.concatenate([view.occupancy.free, view.occupancy.blocked])
        if len(cells) == 0:
            return
        rows, cols = cells.T
        dx_m, dz_m = (self._frame.centres_m(cells) - (view.pose.x_m, view.pose.z_m)).T
        off_rad = np.abs((np.arctan2(dx_m, dz_m) - view.pose.yaw_rad + math.pi) % math.tau - math.pi)
        half_rad = math.atan(0.5 * view.intrinsics.width_px / view.intrinsics.focal_px)
        is_inside = off_rad <= half_rad
        rows, cols, off_rad = rows[is_inside], cols[is_inside], off_rad[is_inside]
        new = np.cos(off_rad / half_rad * (math.pi / 2)) ** 2
        new = config.min_confidence + (1.0 - config.min_confidence) * new
        old = self.confidences[rows, cols]
        counts = (new >= config.ignored_below) | (new >= old)
        rows, cols, new, old = rows[counts], cols[counts], new[counts], old[counts]
        both = new + old
        self.values[rows, cols] = (old * self.values[rows, cols] + new * value) / both
        self.confidences[rows, cols] = (old * old + new * new) / both


def largest_within(values: NDArray[np.float64], frame: MapFrame, place_m: Point2, radius_m: float) -> float:
    """Return the largest of `(R, C)` values within a distance of `(x, z)`; 0 where the map has no cell."""
    steps = math.ceil(radius_m / frame.cell_m)
    at = [(place_m[1] - frame.corner_m[1]) / frame.cell_m, (place_m[0] - frame.corner_m[0]) / frame.cell_m]
    lows = [max(0, math.floor(one) - steps) for one in at]
    window = values[lows[0] : max(0, math.floor(at[0]) + steps + 1), lows[1] : max(0, math.floor(at[1]) + steps + 1)]
    rows = np.arange(window.shape[0]) + lows[0] + 0.5 - at[0]
    cols = np.arange(window.shape[1]) + lows[1] + 0.5 - at[1]
    is_near = np.hypot(rows[:, None], cols[None, :]) * frame.cell_m <= radius_m
    return float(window[is_near].max()) if is_near.any() else 0.0


class Vlfm(OwnExploration):
    """Values are of one goal, so each stage begins with a map without values; floor and objects are kept."""

    config: VlfmConfig = VlfmConfig()

    def _new_navigator(self) -> Navigator:
        navigator = super()._new_navigator()
        navigator.observers.append(lambda _, view, __: self._cones.see(view, self._related.of_view(view.detections)))
        return navigator

    def begin_stage(self, goal: Goal) -> None:
        """Take a new goal; all values are unknown."""
        super().begin_stage(goal)
        self._cones = ConeMap(self._task.map_frame, self.config)
        self._pursuit = Pursuit()

    def _places(self) -> list[Place]:
        values, radius_m = self._cones.values, self.config.value_radius_m
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
