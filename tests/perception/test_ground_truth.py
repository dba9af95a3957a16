"""Ground-truth perception tells labels and never identities."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from evonav.errors import InvalidArgumentError
from evonav.perception.ground_truth import GroundTruthPerception
from evonav.world.pose import Pose
from evonav.world.simulator import Frame, Intrinsics, SceneObject


def body(name: str, category: str, kind: str = "object") -> SceneObject:
    return SceneObject(name, category, kind, (0.0, 0.0, 0.0), (1.0, 1.0, 1.0))


OBJECTS = [body("w", "Wall", "wall"), body("mug|1", "Mug"), body("bed|7", "Bed"), body("mug|2", "Mug")]


def frame(instances: NDArray[np.int32] | None) -> Frame:
    depth_m = np.ones((20, 20), np.float32)
    return Frame(Pose(0, 0, 0, 0), Intrinsics(20, 20, math.pi / 2), depth_m, instances=instances)


def image(*areas: tuple[int, slice, slice]) -> NDArray[np.int32]:
    instances = np.ones((20, 20), np.int32)
    for instance, rows, cols in areas:
        instances[rows, cols] = instance
    return instances


def test_objects_large_enough_are_detected_and_walls_are_not() -> None:
    instances = image((4, slice(0, 6), slice(0, 6)), (2, slice(10, 12), slice(0, 5)), (3, slice(8, 20), slice(8, 20)))
    found = GroundTruthPerception().detect(frame(instances), OBJECTS)
    assert found.labels == ("Mug", "Bed")
    assert found.confidences.tolist() == [1.0, 1.0]
    assert (found.masks == 0).sum() == 36
    assert ((found.masks == 1) == (instances == 3)).all()
    assert (found.masks[instances == 2] == -1).all(), "10 pixels are too few"
    small = GroundTruthPerception(min_area_px=1, max_box_fraction=0.2).detect(frame(instances), OBJECTS)
    assert small.labels == ("Mug", "Mug"), "the bed's box is too large"


def test_detections_do_not_depend_on_how_instances_are_numbered() -> None:
    instances = image((4, slice(0, 6), slice(0, 6)), (3, slice(8, 20), slice(8, 20)), (2, slice(0, 8), slice(9, 17)))
    found = GroundTruthPerception().detect(frame(instances), OBJECTS)
    order = [3, 0, 2, 1]
    renumbered = np.array([0, *np.argsort(order) + 1])[instances].astype(np.int32)
    again = GroundTruthPerception().detect(frame(renumbered), [OBJECTS[i] for i in order])
    assert found.labels == again.labels
    assert (found.masks == again.masks).all()


def test_frames_that_do_not_fit_are_named() -> None:
    with pytest.raises(InvalidArgumentError, match="frame"):
        GroundTruthPerception().detect(frame(None), OBJECTS)
    with pytest.raises(InvalidArgumentError, match="instances"):
        GroundTruthPerception().detect(frame(np.full((20, 20), 9, np.int32)), OBJECTS)
    with pytest.raises(InvalidArgumentError, match="instances"):
        GroundTruthPerception().detect(frame(np.full((20, 20), -1, np.int32)), OBJECTS)
    wrong = replace(frame(None), instances=np.zeros((20, 20)))  # type: ignore[arg-type]
    with pytest.raises((InvalidArgumentError, TypeError), match="instances"):
        GroundTruthPerception().detect(wrong, OBJECTS)
    with pytest.raises(InvalidArgumentError, match="max_box_fraction"):
        GroundTruthPerception(max_box_fraction=2.0).detect(frame(image()), OBJECTS)
