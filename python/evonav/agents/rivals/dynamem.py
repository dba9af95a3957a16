"""DynaMem (Liu et al., ICRA 2025): deletes every point that depth sees through, and explores what it saw long ago."""

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from evonav.agents.agent import AgentAction
from evonav.agents.frontier_update.agent import FrontierUpdateConfig
from evonav.agents.navigator import WITH_FALLBACK, Navigator, NavigatorConfig
from evonav.agents.rivals.exploration import OwnExploration, Place
from evonav.memory.occupancy import BLOCKED, FREE, OccupancyMap
from evonav.points import Point2
from evonav.sensors.observation import MapFrame, Observation, View
from evonav.tasks.public import Goal

NEVER = -1
_AROUND = tuple((row, col) for row in (-1, 0, 1) for col in (-1, 0, 1) if (row, col) != (0, 0))


@dataclass(frozen=True, slots=True)
class DynaMemConfig(FrontierUpdateConfig):
    """DynaMem's constants; those of its deletion are the rule `see-through`'s."""

    navigator: NavigatorConfig = field(default_factory=lambda: replace(WITH_FALLBACK, forgetting="see-through"))
    steepness: float = 0.1
    """Change of the value's logarithmic odds with each view of age."""
    half_age: float = 10.0
    """Number of views since a place was seen at which its value is one half."""
    steps: int = 200
    """Values are rounded up to this part of 1; of equal values the nearest place wins."""
    near_radius_m: float = 0.5
    """Places this near the agent count as seen."""
    padding_cells: int = 2
    """Number of cells around an obstacle in which what was never seen is taken for a part of it."""


class LastSeen:
    """The view in which each cell of the map was last seen."""

    def __init__(self, frame: MapFrame, config: DynaMemConfig) -> None:
        self.config = config
        self._frame = frame
        self._at = np.full((frame.rows, frame.cols), NEVER, np.int64)
        self._num_views = 0

    def see(self, view: View) -> None:
        """Note the cells that a view shows."""
        for cells in (view.occupancy.free, view.occupancy.blocked):
            self._at[cells[:, 0], cells[:, 1]] = self._num_views
        self._num_views += 1

    def be_at(self, here_m: Point2) -> None:
        """Note that the agent stands at `(x, z)`: it has seen what is around."""
        frame = self._frame
        rows = frame.corner_m[1] + (np.arange(frame.rows) + 0.5) * frame.cell_m - here_m[1]
        cols = frame.corner_m[0] + (np.arange(frame.cols) + 0.5) * frame.cell_m - here_m[0]
        is_near = rows[:, None] ** 2 + cols[None, :] ** 2 <= self.config.near_radius_m**2
        self._at[is_near] = np.maximum(self._at[is_near], max(0, self._num_views - 1))

    def give_up(self, place_m: Point2) -> None:
        """Treat the cell at `(x, z)` as seen: the agent went there in vain."""
        self._at[self._frame.cell_at(place_m)] = max(0, self._num_views - 1)

    def values(self) -> NDArray[np.float64]:
        """Return the `(R, C)` value of looking at each cell again: 1 for one that was never seen."""
        config = self.config
        age = (self._num_views - 1 - self._at).astype(np.float64)
        values = 1.0 / (1.0 + np.exp(-config.steepness * (age - config.half_age)))
        return np.where(self._at == NEVER, 1.0, np.ceil(values * config.steps) / config.steps)

    def best_edge(self, occupancy: OccupancyMap, here_m: Point2) -> Place | None:
        """Return the cell beside the reachable floor with the largest value.

        Returns:
            The floor's cell beside it, to stand in, with its own middle and its value; of equal values the nearest,
            then the first. `None` if no floor can be reached.
        """
        is_free = occupancy.cells == FREE
        rows, cols = np.nonzero(is_free)
        middles_m = self._frame.centres_m(np.argwhere(is_free))
        reached = np.zeros_like(is_free)
        if len(rows):
            is_reached = np.isfinite(occupancy.distances_m(here_m, middles_m))
            reached[rows[is_reached], cols[is_reached]] = True
        padding = occupancy.cells == BLOCKED
        for _ in range(self.config.padding_cells):
            padding = _grown(padding)
        is_edge = _grown(reached) & ~reached & ~((self._at == NEVER) & padding)
        rows, cols = np.nonzero(is_edge)
        if len(rows) == 0:
            return None
        values = self.values()[rows, cols]
        places_m = self._frame.centres_m(np.argwhere(is_edge))
        ways_m = np.hypot(places_m[:, 0] - here_m[0], places_m[:, 1] - here_m[1])
        best = int(np.lexsort((ways_m, -values))[0])
        row, col = int(rows[best]), int(cols[best])
        padded = np.pad(reached, 1)
        beside = [(row + r, col + c) for r, c in _AROUND if padded[1 + row + r, 1 + col + c]]
        row, col = min(beside, key=lambda one: math.dist(one, (row, col)))
        face_m = places_m[best].tolist()
        return Place(self._frame.centre_m(row, col), (face_m[0], face_m[1]), float(values[best]))


def _grown(cells: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the `(R, C)` cells, and those beside them in eight directions."""
    padded = np.pad(cells, 1)
    rows, cols = cells.shape
    shifts = (padded[1 + r : 1 + r + rows, 1 + c : 1 + c + cols] for r, c in _AROUND)
    found: NDArray[np.bool_] = np.logical_or.reduce([cells, *shifts])
    return found


class DynaMem(OwnExploration):
    """Goes to a remembered object as long as its points are there; else to what it has not seen for long."""

    config: DynaMemConfig = DynaMemConfig()
    _stops_at_sight_of_place = False

    def _new_navigator(self) -> Navigator:
        navigator = super()._new_navigator()
        self._seen = LastSeen(self._task.map_frame, self.config)
        navigator.observers.append(lambda _, view, __: self._seen.see(view))
        return navigator

    def begin_stage(self, goal: Goal) -> None:
        """Take a new goal; points and times stay."""
        super().begin_stage(goal)
        self._explored: Place | None = None

    def _after_look(self, observation: Observation) -> None:
        self._seen.be_at((observation.pose.x_m, observation.pose.z_m))
        if self._explored is not None and (observation.has_arrived or not observation.is_action_success):
            self._seen.give_up(self._explored.face_m)
            self._explored = None

    def _act_at_place(self, entry_id: int, observation: Observation) -> AgentAction | None:
        """Stop if the look on arrival left the entry's points there; else decide again."""
        if self._navigator.objects.entry(entry_id) is None:
            return None
        return self._stop("verified", entry_id)

    def _place_to_explore(self, observation: Observation) -> Place | None:
        return self._seen.best_edge(self._navigator.explorer.map, (observation.pose.x_m, observation.pose.z_m))

    def _goes_to(self, place: Place, here: Point2) -> None:
        self._explored = place
