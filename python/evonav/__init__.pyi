from ._core import __version__
from .errors import (
    DecisionError,
    EvonavError,
    HouseError,
    InvalidArgumentError,
    SimulationError,
    StoreError,
    TaskError,
)
from .evaluation.contract.check import check_agent
from .report.notebook import load

__all__ = [
    "DecisionError",
    "EvonavError",
    "HouseError",
    "InvalidArgumentError",
    "SimulationError",
    "StoreError",
    "TaskError",
    "__version__",
    "check_agent",
    "load",
]
