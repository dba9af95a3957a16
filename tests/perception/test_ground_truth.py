"""Ground-truth perception tells labels and never identities."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from evonav.errors import InvalidArgumentError
from evonav.house import bundled_houses
from evonav.perception.ground_truth import GroundTruthPerception
from evonav.sensors.observation import Detections
from evonav.world.embedded import EmbeddedSimulator
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


def test_doors_and_windows_are_detected_and_what_else_the_house_is_built_of_is_not() -> None:
    bodies = [
        body("w", "Wall", "wall"),
        body("door|1", "Doorway", "door"),
        body("f", "Floor", "floor"),
        body("door|2", "Doorframe", "door"),
        body("window|1", "Window", "window"),
        body("c", "Ceiling", "ceiling"),
    ]
    rows = [slice(0, 20), slice(0, 6), slice(6, 10), slice(10, 14), slice(14, 18), slice(18, 20)]
    instances = image(*((number, part, slice(0, 20)) for number, part in enumerate(rows, 1)))
    found = GroundTruthPerception().detect(frame(instances), bodies)
    assert found.labels == ("Doorway", "Doorframe", "Window")
    assert [int(mask.sum()) for mask in (found.masks == index for index in range(3))] == [120, 80, 80]
    assert ((found.masks == -1) == np.isin(instances, [1, 3, 6])).all()


def test_the_masks_of_doors_and_windows_are_the_renderers_own() -> None:
    """Every view of a real house: what is detected is what the instance image shows, pixel by pixel."""
    simulator = EmbeddedSimulator()
    pose = simulator.reset(list(bundled_houses())[11].to_json())
    perception = GroundTruthPerception(min_area_px=1, min_area_fraction=0.0)
    kinds = set()
    for place in simulator.reachable_positions()[::40]:
        at = replace(pose, x_m=float(place[0]), z_m=float(place[2]))
        for turn in range(4):
            one = simulator.render(replace(at, yaw_rad=turn * math.pi / 2.0), rgb=False)
            assert one.instances is not None
            found = perception.detect(one, simulator.objects)
            shown = {
                int(instance): simulator.objects[instance - 1] for instance in np.unique(one.instances) if instance
            }
            wanted = [body.category for body in shown.values() if body.kind in ("object", "door", "window")]
            assert sorted(found.labels) == sorted(wanted)
            for index, label in enumerate(found.labels):
                (instance,) = np.unique(one.instances[found.masks == index])
                assert shown[int(instance)].category == label
                assert ((one.instances == instance) == (found.masks == index)).all()
                kinds.add(shown[int(instance)].kind)
    assert kinds == {"object", "door", "window"}


def test_some_of_the_detections_are_numbered_anew() -> None:
    masks = np.array([[0, 1, 2], [2, 1, -1]], np.int32)
    features = np.eye(3, dtype=np.float32)
    found = Detections(masks, ("Bed", "Doorway", "Mug"), np.array([0.3, 0.2, 0.1], np.float32), features)
    taken = found.taken([2, 0])
    assert taken.masks.tolist() == [[1, -1, 0], [0, -1, -1]]
    assert taken.labels == ("Mug", "Bed")
    assert taken.confidences.tolist() == pytest.approx([0.1, 0.3])
    assert taken.features is not None
    assert taken.features.tolist() == [[0, 0, 1], [1, 0, 0]]
    assert found.taken([]).masks.max() == -1
    assert found.taken([0, 1, 2]) is found
