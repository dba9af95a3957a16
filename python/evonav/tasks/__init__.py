"""Tasks on disk: public and oracle parts, apart."""

from evonav.tasks.files import load_task, load_tasks, write_task
from evonav.tasks.manifest import Task
from evonav.tasks.oracle import OracleStage
from evonav.tasks.public import StageInput, TaskInfo

__all__ = ["OracleStage", "StageInput", "Task", "TaskInfo", "load_task", "load_tasks", "write_task"]
