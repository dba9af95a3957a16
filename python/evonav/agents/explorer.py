"""Mapping and exploration, shared by all agents but UniGoal."""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from evonav.agents.grid import eroded
from evonav.memory import Frontier, FrontierConfig, OccupancyMap
from evonav.memory.occupancy import UNKNOWN
from evonav.points import Point2
from evonav.sensors.observation import MapFrame, Observation


@dataclass(frozen=True, slots=True)
class ExplorerConfig:
    """3D-Mem's constants, and values that the paper leaves open."""

    explored_range_m: float = 1.7
    """Seen cells nearer than this are explored."""
    near_radius_m: float = 0.7
    """Free cells this near the agent are explored in any viewing direction."""
    start_radius_m: float = 0.6
    """Cells this near the first pose are assumed to be free, since no camera sees them."""
    min_conflict_cells: int | None = 1
    """Number of contradicting cells that makes the map outdated (1: the paper's oracle occupancy has no noise).

    `None`: the map is never outdated, and the last observation of a cell wins (3D-Mem and MSGNav; paper, Sec. C.3)."""
    conflict_margin_cells: int = 0
    """A contradicting cell counts only if all cells within this many rows and columns contradict the map too.

    This absorbs the noise of predicted occupancy, whose edges waver."""
    reached_m: float = 0.3
    """A frontier this near the agent that is still there after a look is abandoned."""
    frontiers: FrontierConfig = field(default_factory=FrontierConfig)


AS_THREE_D_MEM = ExplorerConfig(min_conflict_cells=None, frontiers=FrontierConfig(min_border_cells=0))
"""3D-Mem's exploration, which MSGNav shares.

The last observation of a cell wins, the map is never cleared, and only regions of unknown floor are frontiers."""
AS_THREE_D_MEM_PLUS = ExplorerConfig(min_conflict_cells=None)
"""The same with our fallback: without any region, unknown cells beside free ones are frontiers."""


class Explorer:
    """An occupancy map that is rebuilt when an observation contradicts it, and the frontiers that are left."""

    def __init__(self, map_frame: MapFrame, config: ExplorerConfig | None = None) -> None:
        self.config = config or ExplorerConfig()
        self._map_frame = map_frame
        self.map = self._new_map()
        self.counters = Counter(conflicts=0, cells_cleared=0, frontiers_reset=0)
        """Number of times that the map was outdated, and of the cells and frontiers that were cleared then."""
        self._is_blank = True
        self._given_up: set[int] = set()
        self._last: Frontier | None = None

    def _new_map(self) -> OccupancyMap:
        config = self.config
        return OccupancyMap(self._map_frame, config.frontiers, explored_range_m=config.explored_range_m)

    def clear(self) -> None:
        """Forget cells, frontiers with their ids, and abandoned frontiers."""
        self.map = self._new_map()
        self._is_blank = True
        self._given_up.clear()
        self._last = None

    def offer_again(self) -> None:
        """Take all abandoned frontiers back: what hid the floor behind them may have been moved."""
        self._given_up.clear()
        self._last = None

    def observe(self, observation: Observation) -> bool:
        """Integrate a round's views; all of them are compared with the map before any is integrated.

        Returns:
            Whether they contradicted the map, which then holds this round's views alone.
        """
        is_outdated = self._is_contradicted(observation)
        if is_outdated:
            num_cleared = int((self.map.cells != UNKNOWN).sum())
            self.counters.update(conflicts=1, cells_cleared=num_cleared, frontiers_reset=len(self.frontiers))
            self.clear()
        here = (observation.pose.x_m, observation.pose.z_m)
        if self._is_blank:
            self.map.assume_free(here, self.config.start_radius_m)
            self._is_blank = False
        for view in observation.views:
            self.map.integrate(view.occupancy, (view.pose.x_m, view.pose.z_m))
        self.map.explore_around(here, self.config.near_radius_m)
        self.map.update_frontiers(here)
        self._give_up_unseeable(observation, here)
        return is_outdated

    def _is_contradicted(self, observation: Observation) -> bool:
        if self.config.min_conflict_cells is None:
            return False
        found = [self.map.conflicts(view.occupancy) for view in observation.views]
        if not any(len(conflicts) for conflicts in found):
            return False
        is_conflict = np.zeros((self._map_frame.rows, self._map_frame.cols), np.bool_)
        for conflicts in found:  # views overlap: a cell counts once
            for cells in (conflicts.freed, conflicts.obstructed):
                is_conflict[cells[:, 0], cells[:, 1]] = True
        num_conflicting = int(eroded(is_conflict, self.config.conflict_margin_cells).sum())
        return num_conflicting >= self.config.min_conflict_cells

    def _give_up_unseeable(self, observation: Observation, here: Point2) -> None:
        """Abandon the chosen frontier if it is still there although it was reached, or could not be.

        It would be chosen for ever.
        """
        last = self._last
        if last is None:
            return
        is_done = observation.has_arrived or not observation.is_action_success
        if is_done or math.dist(here, last.position_m) <= self.config.reached_m:
            self._given_up.add(last.id)
            self._last = None

    @property
    def frontiers(self) -> list[Frontier]:
        """The frontiers that are left to explore, by ascending id."""
        return [frontier for frontier in self.map.frontiers if frontier.id not in self._given_up]

    def go_to(self, frontier: Frontier) -> tuple[Point2, Point2]:
        """Remember that the agent goes to a frontier; return where to stand, and a point to face."""
        self._last = frontier
        x_m, z_m = frontier.position_m
        ahead = (x_m + math.sin(frontier.direction_rad), z_m + math.cos(frontier.direction_rad))
        return frontier.position_m, ahead

    def ways_m(self, here: Point2, places_m: Sequence[Point2], detour: float = 1.0) -> list[float]:
        """Return the length of the way to each place over known floor; `detour` straight lines where none leads."""
        if not places_m:
            return []
        return [
            way_m if math.isfinite(way_m) else detour * math.dist(here, place_m)
            for way_m, place_m in zip(self.map.distances_m(here, np.array(places_m)).tolist(), places_m, strict=True)
        ]

    def is_going_to(self, frontier: Frontier) -> bool:
        """Return whether the agent last went to this frontier and is not there yet."""
        return self._last is not None and self._last.id == frontier.id

    def stop_exploring(self) -> None:
        """Note that the agent goes elsewhere: its arrival says nothing about a frontier."""
        self._last = None


def nearest_frontier(frontiers: list[Frontier], point_m: Point2) -> Frontier | None:
    """Return the frontier whose position is nearest to a point; of two as near, the older one."""
    return min(frontiers, key=lambda f: (math.dist(f.position_m, point_m), f.id), default=None)
