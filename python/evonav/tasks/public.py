"""The public part of a task: all that an agent receives."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from evonav.sensors.observation import MapFrame


@dataclass(frozen=True, slots=True)
class TaskInfo:
    """An agent's information before the first stage.

    Examples:
        >>> import evonav
        >>> simulator = evonav.Simulator(evonav.load_houses()[0])
        >>> task = evonav.TaskInfo("mine", num_stages=1, max_rounds=50, map_frame=simulator.map_frame, seed=0)
        >>> task.map_frame.cell_m
        0.1
    """

    task_id: str
    """A name for the task in this run, the same for all its agents. Another run has another name: it tells nothing."""
    num_stages: int
    max_rounds: int
    """Decision rounds per stage (paper: 50)."""
    map_frame: MapFrame
    seed: int
    """Seed for the agent's own random choices."""


@dataclass(frozen=True, slots=True)
class Goal:
    """The goal input `g_k` (paper, Sec. A.3) without its start pose, which would reveal the previous target.

    Instructions follow the grammar of `evonav.tasks.language`.

    Examples:
        >>> import evonav
        >>> goal = evonav.load_tasks("bundled")[1].public(stage=1)
        >>> goal.category, goal.reference_image.shape
        ('Vase', (300, 300, 3))
    """

    stage: int
    """Number of the stage, from 1."""
    category: str
    basic_instruction: str
    appearance_instruction: str
    unified_instruction: str
    reference_image: NDArray[np.uint8] = field(repr=False)
    """`(300, 300, 3)` RGB image."""
