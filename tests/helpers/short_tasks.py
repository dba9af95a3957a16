"""Bundled tasks cut to their first stages, for tests that need no more."""

from dataclasses import replace
from pathlib import Path

from evonav.component import Component
from evonav.evaluation.episode.spec import EpisodeSpec
from evonav.evaluation.run.components import load_spec
from evonav.tasks.listing import TaskFile, task_files


def load_short(path: Path, num_stages: int) -> EpisodeSpec:
    """Read the first stages of a task."""
    spec = load_spec(path)
    return replace(spec, stages=spec.stages[:num_stages])


def short_tasks(directory: Path, num_stages: int, limit: int = 1) -> tuple[list[TaskFile], Component[EpisodeSpec]]:
    """List the first tasks of a folder as of so many stages, and return the component that reads them."""
    tasks = [replace(task, num_stages=num_stages) for task in task_files(directory, limit)]
    return tasks, Component("short_tasks:load_short", {"num_stages": num_stages})
