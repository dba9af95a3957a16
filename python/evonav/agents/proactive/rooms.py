"""Rooms of the agent's own map: free floor, cut where it is as narrow as a door."""

import numpy as np
from numpy.typing import NDArray

from evonav.agents.grid import NO_GROUP, box_slices, eroded, grown, numbered
from evonav.decision.candidates import ObjectCandidate
from evonav.memory.occupancy import FREE
from evonav.sensors.observation import MapFrame

NO_ROOM = NO_GROUP
"""Number of what is in no room."""
DOOR_HALF_WIDTH_M = 0.6
"""Floor less than twice this wide is a neck: ProcTHOR's doorways are about a metre wide."""
MIN_ROOM_M2 = 0.25
"""Smallest core of a room: what is left of it after this width is taken from all of its edges."""
SHRINK = 2
"""Rooms are found on a grid of blocks of this many rows and columns of cells."""
MAX_GROWTH_M = 2.0
"""Distance over which rooms grow back from their cores."""


def rooms_of(cells: NDArray[np.uint8], frame: MapFrame, furniture: list[ObjectCandidate]) -> NDArray[np.int32]:
    """Return the room of each cell.

    Args:
        furniture: Remembered objects; the floor under them belongs to a room, as they are no walls.

    Returns:
        `(R, C)` numbers of rooms from 0, by row and column of their first core cell; `NO_ROOM` elsewhere.
    """
    floor = cells == FREE
    for one in furniture:
        if one.centre_m[1] - one.size_m[1] / 2 < 0.3:  # it stands on the floor
            floor[box_slices(one, frame, 0.0)] = True
    edge_m, (rows, cols) = frame.cell_m * SHRINK, (size // SHRINK for size in floor.shape)
    blocks = floor[: rows * SHRINK, : cols * SHRINK].reshape(rows, SHRINK, cols, SHRINK).transpose(1, 3, 0, 2)
    depth = max(1, round(DOOR_HALF_WIDTH_M / edge_m))
    cores = numbered(eroded(blocks.all(axis=(0, 1)), depth), min_cells=max(1, round(MIN_ROOM_M2 / edge_m**2)))
    small_rooms = grown(cores, blocks.any(axis=(0, 1)), round(MAX_GROWTH_M / edge_m))
    rooms = np.full(floor.shape, NO_ROOM, np.int32)
    large = small_rooms.repeat(SHRINK, axis=0).repeat(SHRINK, axis=1)
    rooms[: large.shape[0], : large.shape[1]] = large
    rooms[~floor] = NO_ROOM
    return rooms
