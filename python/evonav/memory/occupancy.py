"""Maintain the agent's occupancy map and its frontiers."""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from evonav import _core
from evonav._core import Frontier
from evonav.sensors.observation import MapFrame, View, VisibleOccupancy

if TYPE_CHECKING:  # agents start fast, and few draw
    from evonav.drawing.pictures import Picture

__all__ = ["BLOCKED", "FREE", "UNKNOWN", "Conflicts", "Frontier", "FrontierConfig", "OccupancyMap"]

UNKNOWN, FREE, BLOCKED = 0, 1, 2
OPEN_STEPS = 8
"""Values of `OccupancyMap.cells`."""
EXPLORED = 3
"""Value of a free cell that was seen from near, in pictures."""


@dataclass(frozen=True, slots=True)
class FrontierConfig:
    """Conditions for free cells to be a frontier (3D-Mem's parameters, and a last resort of our own)."""

    min_cells: int = 20
    """Smallest number of cells of a region."""
    min_border_cells: int = 3
    """Fallback without such regions: smallest group of unknown cells beside free ones; 0 for none, as in 3D-Mem."""
    max_span_deg: float = 150.0
    """Angle seen from the agent above which a region is split."""
    clearance_m: float = 0.5
    """Distance from an obstacle within which a view position is moved away."""
    push_step_m: float = 0.05
    """Step in which the view position is moved away."""
    max_push_m: float = 0.3
    """Largest distance that the view position is moved away."""

    @property
    def max_span_rad(self) -> float:
        """`max_span_deg` in radians."""
        return math.radians(self.max_span_deg)


@dataclass(frozen=True, slots=True)
class Conflicts:
    """Observed cells whose state contradicts the map."""

    freed: NDArray[np.int32]
    """`(N, 2)` `[row, col]`: remembered as blocked, now seen free."""
    obstructed: NDArray[np.int32]
    """`(N, 2)` `[row, col]`: remembered as free, now seen blocked."""

    def __len__(self) -> int:
        """Return the number of contradicting cells."""
        return len(self.freed) + len(self.obstructed)


class OccupancyMap:
    """Unknown, free and blocked cells, the cells seen from near (*explored*), and the frontiers.

    Only `update` (or `integrate`) sets cells; the last observation of a cell counts.

    Examples:
        >>> import evonav
        >>> simulator = evonav.Simulator(evonav.load_houses()[2])
        >>> cells = evonav.OccupancyMap(simulator.map_frame)
        >>> conflicts = cells.update(simulator.look(rgb=False))
        >>> frontiers = cells.update_frontiers((simulator.pose.x_m, simulator.pose.z_m))
        >>> len(frontiers) > 0
        True
        >>> picture = cells.plot()
    """

    def __init__(
        self, map_frame: MapFrame, frontiers: FrontierConfig | None = None, *, explored_range_m: float = 1.7
    ) -> None:
        """Make a map of unknown cells.

        Args:
            map_frame: Shape and place of the cells.
            explored_range_m: Distance within which seen cells are explored (3D-Mem: 1.7 m).

        Raises:
            InvalidArgumentError: A parameter is out of range; the message names it.
        """
        self.map_frame = map_frame
        self.explored_range_m = explored_range_m
        self._map = _core.OccupancyMap(map_frame, frontiers or FrontierConfig())

    @property
    def cells(self) -> NDArray[np.uint8]:
        """Cells, an `(R, C)` copy: `UNKNOWN`, `FREE` or `BLOCKED`."""
        return self._map.cells

    @property
    def explored(self) -> NDArray[np.bool_]:
        """Explored cells, an `(R, C)` copy: `True` if the cell was seen from near."""
        return self._map.explored

    def known_share(self, centre_m: tuple[float, float], radius_m: float) -> float:
        """Return the known share of the cells around `(x, z)`; cells behind walls and furniture do not count.

        An unknown cell counts if it can be reached from a free one over at most `OPEN_STEPS` unknown cells.
        """
        frame = self.map_frame
        at_x, at_z = (round((centre_m[axis] - frame.corner_m[axis]) / frame.cell_m - 0.5) for axis in (0, 1))
        reach = max(1, round(radius_m / frame.cell_m))
        rows, cols = (slice(max(0, at - reach), max(0, at + reach + 1)) for at in (at_z, at_x))
        cells = self._map.cells[rows, cols]
        unknown = cells == UNKNOWN
        reached = cells == FREE
        num_known = int(cells.size - unknown.sum())
        for _ in range(OPEN_STEPS):
            grown = reached.copy()
            grown[1:] |= reached[:-1]
            grown[:-1] |= reached[1:]
            grown[:, 1:] |= reached[:, :-1]
            grown[:, :-1] |= reached[:, 1:]
            grown &= unknown | reached
            if (grown == reached).all():
                break
            reached = grown
        num_open = int((reached & unknown).sum())
        return num_known / (num_known + num_open) if num_known else 0.0

    def distances_m(self, start_m: tuple[float, float], targets_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the lengths of the shortest ways over free cells.

        Args:
            start_m: Start, `(x, z)`.
            targets_m: Targets, `(N, 2)` float64.

        Returns:
            Metres, `(N,)` float64; `inf` for targets that no free cells connect with the start.

        Raises:
            InvalidArgumentError: A coordinate is not finite.
        """
        return self._map.distances_m(start_m, targets_m)

    def conflicts(self, seen: VisibleOccupancy) -> Conflicts:
        """Return the seen cells that contradict the map, which does not change."""
        return Conflicts(*self._map.conflicts(seen.free, seen.blocked))

    def integrate(self, seen: VisibleOccupancy, origin_m: tuple[float, float]) -> Conflicts:
        """Integrate the cells that one view saw.

        Args:
            seen: Observed cells of this map.
            origin_m: The camera's `(x, z)`.

        Returns:
            The cells that contradicted the map before.

        Raises:
            InvalidArgumentError: A cell is off the map, or a number is not finite; the map does not change then.
        """
        return Conflicts(
            *self._map.integrate(seen.free, seen.blocked, origin_m=origin_m, explored_range_m=self.explored_range_m)
        )

    def update(self, view: View) -> Conflicts:
        """Integrate the cells that a view saw: `integrate` with the view's own occupancy and position."""
        return self.integrate(view.occupancy, (view.pose.x_m, view.pose.z_m))

    def __repr__(self) -> str:
        """Return the size and the numbers of known cells."""
        cells, frame = self.cells, self.map_frame
        num_free, num_blocked = int((cells == FREE).sum()), int((cells == BLOCKED).sum())
        size = f"{frame.rows} x {frame.cols} cells of {frame.cell_m:g} m"
        return f"OccupancyMap({size}: {num_free} free, {num_blocked} blocked)"

    def plot(self) -> "Picture":
        """Draw the cells from above, explored ones in blue, with the frontiers."""
        from evonav.drawing.pictures import cells_picture

        cells = np.where((self.cells == FREE) & self.explored, EXPLORED, self.cells).astype(np.uint8)
        points = [(f"frontier {frontier.id}", frontier.position_m) for frontier in self.frontiers]
        return cells_picture(cells, self.map_frame, points, "occupancy map")

    def explore_around(self, centre_m: tuple[float, float], radius_m: float = 0.7) -> None:
        """Mark the free cells around `(x, z)` as explored: where the agent has been, it has looked."""
        self._map.explore_around(centre_m, radius_m)

    def assume_free(self, centre_m: tuple[float, float], radius_m: float = 0.6) -> None:
        """Treat the unknown cells around `(x, z)` as free and explored until seen; they never cause a conflict."""
        self._map.assume_free(centre_m, radius_m)

    def forget(self, cells: NDArray[np.int32]) -> None:
        """Make `(N, 2)` `[row, col]` cells unknown and unexplored."""
        self._map.forget(cells)

    def clear(self) -> None:
        """Remove cells and frontiers; frontier ids continue."""
        self._map.clear()

    def clear_frontiers(self) -> None:
        """Remove the frontiers; ids continue."""
        self._map.clear_frontiers()

    @property
    def frontiers(self) -> list[Frontier]:
        """The frontiers of the last `update_frontiers`, by ascending id."""
        return self._map.frontiers

    def update_frontiers(self, agent_m: tuple[float, float]) -> list[Frontier]:
        """Update the frontiers by the cells.

        A frontier whose region has hardly changed has the same id, position and direction as before.

        Args:
            agent_m: The agent's `(x, z)`; frontiers lie on the free floor connected to it.
        """
        return self._map.update_frontiers(agent_m)
