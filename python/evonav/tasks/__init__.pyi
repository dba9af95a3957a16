from .files import load_task, load_tasks, write_task
from .manifest import Task
from .oracle import OracleStage
from .public import StageInput, TaskInfo

__all__ = ["OracleStage", "StageInput", "Task", "TaskInfo", "load_task", "load_tasks", "write_task"]
