"""EvoNav-Bench: lifelong navigation in homes that change."""

from evonav._core import __version__
from evonav.errors import (
    DecisionError,
    EvonavError,
    HouseError,
    InvalidArgumentError,
    SimulationError,
    StoreError,
    TaskError,
)

__all__ = [
    "DecisionError",
    "EvonavError",
    "HouseError",
    "InvalidArgumentError",
    "SimulationError",
    "StoreError",
    "TaskError",
    "__version__",
]
