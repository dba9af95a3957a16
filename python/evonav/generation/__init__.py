"""Tasks made from houses."""

from evonav.generation.pipeline import TaskRejectedError, generate_task
from evonav.tasks import write_task
from evonav.tasks.parameters import GenerationParameters

__all__ = [
    "GenerationParameters",
    "TaskRejectedError",
    "generate_task",
    "write_task",
]
