"""One error tree, created in Rust: everything evonav raises is an `EvonavError`."""

from evonav._core import (
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
    "PerceptionError",
    "SimulationError",
    "SimulatorLostError",
    "StoreError",
    "TaskError",
]


class SimulatorLostError(SimulationError):
    """The simulator's process has ended or hangs; the simulator's next `reset` starts another."""


class PerceptionError(EvonavError):
    """A perception's library, weights or device cannot be had."""
