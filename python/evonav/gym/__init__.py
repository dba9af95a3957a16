"""Gymnasium environments over the embedded simulator; importing this registers `evonav/LifelongNav-v0`.

The environments themselves are imported when they are first used, so that naming the id costs nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from evonav.gym.registration import ENV_ID, register

if TYPE_CHECKING:
    from evonav.gym.config import ACTIONS, OBSERVATIONS, NavConfig
    from evonav.gym.env import LifelongNavEnv
    from evonav.gym.spaces import vocabulary
    from evonav.gym.vector_env import VectorEnv

__all__ = ["ACTIONS", "ENV_ID", "OBSERVATIONS", "LifelongNavEnv", "NavConfig", "VectorEnv", "register", "vocabulary"]

_MODULES = {
    "ACTIONS": "config",
    "OBSERVATIONS": "config",
    "LifelongNavEnv": "env",
    "NavConfig": "config",
    "VectorEnv": "vector_env",
    "vocabulary": "spaces",
}

register()


def __getattr__(name: str) -> Any:  # noqa: ANN401 - of any of the names
    if name not in _MODULES:
        raise AttributeError(f"module `evonav.gym` has no attribute `{name}`")
    return getattr(import_module(f"evonav.gym.{_MODULES[name]}"), name)
