"""Define a perception: frames in; detections out, with the depth and the pose that the agent is to believe."""

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from evonav.sensors.observation import Detections
from evonav.tasks.public import Goal
from evonav.world.pose import Pose
from evonav.world.simulator import Frame, SceneObject


@dataclass(frozen=True, slots=True)
class StageScene:
    """Input of a perception at the start of a stage. It is on the evaluator's side: the objects are oracle data."""

    task_id: str
    goal: Goal
    agent: str
    """Name of the agent that is given the percepts: published agents have detectors of their own."""
    seed: int
    """Seed of random errors, with `task_id` and the stage. It is the same for all agents of a run.

    Agents are thus compared under the same errors."""
    objects: Sequence[SceneObject]
    """Bodies in instance order."""


@dataclass(frozen=True, slots=True)
class Percept:
    """A frame as the agent perceives it."""

    detections: Detections
    depth_m: NDArray[np.float32]
    """`(H, W)` planar z, `inf` where nothing is; the frame's own where the perception does not err about it."""
    pose: Pose
    """Pose of the camera, as in `Frame`; the frame's own where the perception does not err about it."""


class Perception(Protocol):
    """Turns rendered frames into percepts. One serves one episode; models behind it are loaded once a process.

    Only `perceive` has no default.
    """

    @property
    def needs_rgb(self) -> bool:
        """Whether frames must have colours, which cost more than the rest of them."""
        return False

    def begin_stage(self, scene: StageScene) -> None:
        """Begin a stage of the episode; stages come in order, each once."""
        self.change_scene(scene)

    def change_scene(self, scene: StageScene) -> None:
        """Take in that the house changes during the stage: `scene` has other objects, and rounds go on.

        Only tasks with changes during stages need it (docs/extensions.md).
        """
        return

    @abstractmethod
    def perceive(self, frames: Sequence[Frame]) -> Sequence[Percept]:
        """Perceive the views of one round, as one batch.

        Args:
            frames: Rendered with instances; the heading view last.

        Returns:
            One percept a frame. Detections hold no ids, and neither numbers nor order tell which instance one is.
        """

    def text_feature(self, text: str) -> NDArray[np.float32] | None:
        """`(D,)` unit feature of a text, comparable with those of detections; `None` if they have none."""
        return None
