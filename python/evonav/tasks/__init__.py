"""Tasks on disk: public and oracle parts, apart.

Names are imported when they are first used, so that who needs the public part alone, such as an agent in a process of
its own, loads nothing of the oracle.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from evonav.tasks.files import load_task, load_tasks, write_task
    from evonav.tasks.manifest import Task
    from evonav.tasks.oracle import OracleStage
    from evonav.tasks.public import StageInput, TaskInfo

__all__ = ["OracleStage", "StageInput", "Task", "TaskInfo", "load_task", "load_tasks", "write_task"]

_MODULES = {
    "OracleStage": "oracle",
    "StageInput": "public",
    "Task": "manifest",
    "TaskInfo": "public",
    "load_task": "files",
    "load_tasks": "files",
    "write_task": "files",
}


def __getattr__(name: str) -> Any:  # noqa: ANN401 - of any of the names
    if name not in _MODULES:
        raise AttributeError(f"module `evonav.tasks` has no attribute `{name}`")
    return getattr(import_module(f"evonav.tasks.{_MODULES[name]}"), name)
