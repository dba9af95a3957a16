"""The agent's occupancy map and its frontiers."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evonav import _core
from evonav._core import Frontier
from evonav.sensors.observation import MapFrame, VisibleOccupancy

__all__ = ["BLOCKED", "FREE", "UNKNOWN", "Conflicts", "Frontier", "FrontierConfig", "OccupancyMap"]

UNKNOWN, FREE, BLOCKED = 0, 1, 2
"""Values of `OccupancyMap.cells`."""


@dataclass(frozen=True, slots=True)
class FrontierConfig:
    """When free cells are a frontier (3D-Mem's parameters, and a last resort of our own)."""

    min_cells: int = 20
    """Fewest cells of a region."""
    min_border_cells: int = 3
    """Without such regions, groups of so many unknown cells beside free ones are frontiers; 0: never, as in 3D-Mem."""
    max_span_deg: float = 150.0
    """A region wider than this, seen from the agent, is split."""
    clearance_m: float = 0.5
    """A view position is moved away from an obstacle nearer than this ..."""
    push_step_m: float = 0.05
    """... in steps of this ..."""
    max_push_m: float = 0.3
    """... and at most this far."""


@dataclass(frozen=True, slots=True)
class Conflicts:
    """Seen cells whose state contradicts the map."""

    freed: NDArray[np.int32]
    """`(N, 2)` `[row, col]`: remembered blocked, now seen free."""
    obstructed: NDArray[np.int32]
    """`(N, 2)` `[row, col]`: remembered free, now seen blocked."""

    def __len__(self) -> int:
        """Number of contradicting cells."""
        return len(self.freed) + len(self.obstructed)


class OccupancyMap:
    """Unknown, free and blocked cells, which of them were seen from close by (*explored*), and the frontiers.

    Cells are told only by `integrate`; the last observation of a cell wins.
    """

    def __init__(
        self, map_frame: MapFrame, frontiers: FrontierConfig | None = None, *, explored_range_m: float = 1.7
    ) -> None:
        """A map of unknown cells.

        Args:
            map_frame: Shape and place of the cells.
            frontiers: Parameters of the frontiers.
            explored_range_m: Seen cells nearer than this are explored (3D-Mem: 1.7 m).

        Raises:
            InvalidArgumentError: A parameter is outside its domain; the message names it.
        """
        frontiers = frontiers or FrontierConfig()
        self.map_frame = map_frame
        self.explored_range_m = explored_range_m
        self._map = _core.OccupancyMap(
            rows=map_frame.rows,
            cols=map_frame.cols,
            cell_m=map_frame.cell_m,
            corner_m=map_frame.corner_m,
            min_cells=frontiers.min_cells,
            min_border_cells=frontiers.min_border_cells,
            max_span_rad=math.radians(frontiers.max_span_deg),
            clearance_m=frontiers.clearance_m,
            push_step_m=frontiers.push_step_m,
            max_push_m=frontiers.max_push_m,
        )

    @property
    def cells(self) -> NDArray[np.uint8]:
        """`(R, C)` copy: `UNKNOWN`, `FREE` or `BLOCKED`."""
        return self._map.cells

    @property
    def explored(self) -> NDArray[np.bool_]:
        """`(R, C)` copy: whether the cell was seen from close by."""
        return self._map.explored

    def conflicts(self, seen: VisibleOccupancy) -> Conflicts:
        """Seen cells that contradict the map, which stays as it is."""
        return Conflicts(*self._map.conflicts(seen.free, seen.blocked))

    def integrate(self, seen: VisibleOccupancy, origin_m: tuple[float, float]) -> Conflicts:
        """Takes over what one view saw.

        Args:
            seen: Cells of this map.
            origin_m: `(x, z)` of the camera.

        Returns:
            What contradicted the map before.

        Raises:
            InvalidArgumentError: A cell is off the map (which then stays as it is), or a number is not finite.
        """
        return Conflicts(
            *self._map.integrate(seen.free, seen.blocked, origin_m=origin_m, explored_range_m=self.explored_range_m)
        )

    def explore_around(self, centre_m: tuple[float, float], radius_m: float = 0.7) -> None:
        """Marks the free cells around `(x, z)` explored: where the agent has been, it has looked."""
        self._map.explore_around(centre_m, radius_m)

    def assume_free(self, centre_m: tuple[float, float], radius_m: float = 0.6) -> None:
        """Takes the unknown cells around `(x, z)` for free and explored until seen; they never make a conflict."""
        self._map.assume_free(centre_m, radius_m)

    def forget(self, cells: NDArray[np.int32]) -> None:
        """Makes `(N, 2)` `[row, col]` cells unknown and unexplored."""
        self._map.forget(cells)

    def clear(self) -> None:
        """Forgets cells and frontiers; frontier ids go on counting."""
        self._map.clear()

    def clear_frontiers(self) -> None:
        """Drops the frontiers; ids go on counting."""
        self._map.clear_frontiers()

    @property
    def frontiers(self) -> list[Frontier]:
        """Those of the last `update_frontiers`, by ascending id."""
        return self._map.frontiers

    def update_frontiers(self, agent_m: tuple[float, float]) -> list[Frontier]:
        """Brings the frontiers up to date with the cells.

        A frontier whose region has hardly changed keeps its id, position and direction.

        Args:
            agent_m: `(x, z)`; frontiers lie on the free floor connected to it.
        """
        return self._map.update_frontiers(agent_m)
