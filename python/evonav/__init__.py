"""EvoNav-Bench: lifelong navigation in homes that change."""

import sys
from importlib import import_module
from typing import Any

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
    "check_agent",
    "load",
]

if "gymnasium" in sys.modules:  # which imports this package to look for `evonav:evonav/LifelongNav-v0`
    import_module("evonav.gym.registration").register()


def __getattr__(name: str) -> Any:  # noqa: ANN401 - of a module
    """What is imported when it is first used, so that the package starts fast."""
    if name == "check_agent":
        return import_module("evonav.evaluation.agent_check").check_agent
    if name == "load":
        return import_module("evonav.report.notebook").load
    raise AttributeError(f"module `evonav` has no attribute `{name}`")
