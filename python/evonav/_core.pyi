"""Stub of the Rust extension; `mypy.stubtest evonav._core` holds it to the binary."""

from typing import final

import numpy as np
from numpy.typing import NDArray

__version__: str

class EvonavError(Exception): ...
class HouseError(EvonavError): ...
class TaskError(EvonavError): ...
class SimulationError(EvonavError): ...
class DecisionError(EvonavError): ...
class StoreError(EvonavError): ...
class InvalidArgumentError(EvonavError): ...

# sensors

def visible_cells(
    blocked: NDArray[np.uint8],
    *,
    cell_m: float,
    corner_m: tuple[float, float],
    origin_m: tuple[float, float],
    yaw_rad: float,
    horizontal_fov_rad: float,
    range_m: float,
) -> tuple[NDArray[np.int32], NDArray[np.int32]]: ...
def number_instances(
    instances: NDArray[np.int32],
    is_detectable: NDArray[np.bool_],
    *,
    min_area_px: int,
    max_box_fraction: float,
) -> tuple[NDArray[np.int32], NDArray[np.int64]]: ...

# memory

@final
class Frontier:
    """A place to explore from."""

    @property
    def id(self) -> int:
        """Never used twice by one map."""

    @property
    def position_m(self) -> tuple[float, float]:
        """`(x, z)` where to stand."""

    @property
    def direction_rad(self) -> float:
        """Where to look, as a yaw."""

    @property
    def cells(self) -> NDArray[np.int32]:
        """`(N, 2)` `[row, col]` of the region, row-major."""

@final
class OccupancyMap:
    def __new__(
        cls,
        *,
        rows: int,
        cols: int,
        cell_m: float,
        corner_m: tuple[float, float],
        min_cells: int = 20,
        max_span_rad: float = ...,
        clearance_m: float = 0.5,
        push_step_m: float = 0.05,
        max_push_m: float = 0.3,
    ) -> OccupancyMap: ...
    def conflicts(
        self, free: NDArray[np.int32], blocked: NDArray[np.int32]
    ) -> tuple[NDArray[np.int32], NDArray[np.int32]]: ...
    def integrate(
        self,
        free: NDArray[np.int32],
        blocked: NDArray[np.int32],
        *,
        origin_m: tuple[float, float],
        explored_range_m: float,
    ) -> tuple[NDArray[np.int32], NDArray[np.int32]]: ...
    def explore_around(self, centre_m: tuple[float, float], radius_m: float) -> None: ...
    def assume_free(self, centre_m: tuple[float, float], radius_m: float) -> None: ...
    def forget(self, cells: NDArray[np.int32]) -> None: ...
    def clear(self) -> None: ...
    def clear_frontiers(self) -> None: ...
    def update_frontiers(self, agent_m: tuple[float, float]) -> list[Frontier]: ...
    @property
    def frontiers(self) -> list[Frontier]: ...
    @property
    def cells(self) -> NDArray[np.uint8]: ...
    @property
    def explored(self) -> NDArray[np.bool_]: ...
