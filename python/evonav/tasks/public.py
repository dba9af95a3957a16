"""The public part of a task: all that an agent receives."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from evonav.sensors.observation import MapFrame


@dataclass(frozen=True, slots=True)
class TaskInfo:
    """An agent's information before the first stage."""

    task_id: str
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
    """

    stage: int
    """Number of the stage, from 1."""
    category: str
    basic_instruction: str
    appearance_instruction: str
    unified_instruction: str
    reference_image: NDArray[np.uint8] = field(repr=False)
    """`(300, 300, 3)` RGB image."""
