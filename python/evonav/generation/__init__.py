"""Tasks made from houses."""

from evonav.generation.pipeline import Rejections, TaskRejectedError, generate_task, generate_tasks
from evonav.tasks import write_task
from evonav.tasks.parameters import GenerationParameters

__all__ = [
    "GenerationParameters",
    "Rejections",
    "TaskRejectedError",
    "generate_task",
    "generate_tasks",
    "write_task",
]
