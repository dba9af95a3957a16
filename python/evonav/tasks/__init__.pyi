from .files import load_task, load_tasks, write_task
from .manifest import Task
from .oracle import OracleStage
from .public import Goal, TaskInfo

__all__ = ["Goal", "OracleStage", "Task", "TaskInfo", "load_task", "load_tasks", "write_task"]
