"""Ground-truth perception: the simulator's masks and labels, without its ids."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from evonav import _core
from evonav._core import RunImage
from evonav.errors import InvalidArgumentError
from evonav.perception.perception import Percept, Perception, StageScene
from evonav.sensors.observation import Detections
from evonav.world.run_images import unexpanded
from evonav.world.simulator import Frame, SceneObject

DETECTED_KINDS = ("object", "door", "window")
"""Kinds of bodies that are detected; what the house is built of otherwise is background to every agent."""


@dataclass(slots=True)
class GroundTruthPerception(Perception):
    """Masks and labels of the objects in a frame (the paper's ground-truth setting).

    3D-Mem's area filters hold here as well. Its limit on a mask's bounding box (half the image) is off by default: it
    is there for a detector's mistakes, and would hide a bed from an agent that stands in front of it.
    """

    min_area_px: int = 25
    """Fewest pixels of a mask."""
    min_area_fraction: float = 0.001
    """Smallest part of the image that a mask covers."""
    max_box_fraction: float = 1.0
    """Largest part of the image that a mask's bounding box covers."""
    _objects: Sequence[SceneObject] = field(default=(), init=False, repr=False)
    _is_detected: NDArray[np.bool_] = field(
        default_factory=lambda: _are_detected(()), init=False, repr=False, compare=False
    )
    """True for each of the stage's objects that is detected."""

    def change_scene(self, scene: StageScene) -> None:
        """Store the objects of the house."""
        self._objects, self._is_detected = scene.objects, _are_detected(scene.objects)

    def perceive(self, frames: Sequence[Frame]) -> list[Percept]:
        """Return each frame as it is."""
        return [Percept(self.detect(frame, self._objects), frame.depth_m, frame.pose) for frame in frames]

    def detect(self, frame: Frame, objects: Sequence[SceneObject]) -> Detections:
        """Return the objects, doors and windows in a frame; walls, floors and ceilings are background.

        The mask of a door is its frame and its leaf, that of a window its frame and its pane.

        Detections are renumbered in every frame, in the order of their first pixel: neither numbers nor their
        order tell which instance a detection is.

        Args:
            frame: Rendered with instances.
            objects: The simulator's bodies, in instance order.

        Returns:
            Detections labelled with ProcTHOR's type (a door's is `Doorway`, or `Doorframe` without a leaf), confidence
            1, no features.

        Raises:
            InvalidArgumentError: The frame has no instances, they are outside `objects`, or a parameter of this
                perception is outside its domain.
        """
        masks, instances = self.number(frame, objects)
        return Detections(
            masks=unexpanded(masks),
            labels=tuple([objects[index].category for index in instances]),
            confidences=np.ones(len(instances), np.float32),
        )

    def number(self, frame: Frame, objects: Sequence[SceneObject]) -> tuple[RunImage, list[int]]:
        """Return numbered masks, and the index into `objects` of each: oracle data.

        Raises:
            InvalidArgumentError: See `detect`.
        """
        instances = frame.stored_instances
        if instances is None:
            raise InvalidArgumentError("argument `frame` has no instances, expected a frame rendered with them")
        return _core.number_instances(
            instances,
            self._is_detected if objects is self._objects else _are_detected(objects),
            min_area_px=self.min_px(frame),
            max_box_fraction=self.max_box_fraction,
        )

    def min_px(self, frame: Frame) -> int:
        """Return the fewest pixels of a mask in a frame."""
        return max(self.min_area_px, round(self.min_area_fraction * frame.depth_m.size))


def _are_detected(objects: Sequence[SceneObject]) -> NDArray[np.bool_]:
    return np.array([body.kind in DETECTED_KINDS for body in objects], np.bool_)
