"""The instruments of `scripts/measure_pictures.py`: two sets of houses, seeded views, matching and statistics."""

import itertools

import measure_pictures
import numpy as np
import pytest
from picture_statistics import statistics_of
from picture_views import CLASSES_OF_TYPE, PictureView, Truth, houses_of_set, views

from evonav.perception.coco import COCO_CLASSES
from evonav.perception.models.yolov4_tiny import Boxes
from evonav.perception.vocabulary import PROCTHOR_TYPES
from evonav.world.pose import Pose
from evonav.world.simulator import Frame, Intrinsics


def test_no_house_is_in_both_sets() -> None:
    design, held_out = (houses_of_set(["bundled"], which) for which in ("design", "held-out"))
    assert not {house.digest for house in design} & {house.digest for house in held_out}
    assert len(design) + len(held_out) == 151
    assert min(len(design), len(held_out)) > 50


def test_files_without_a_house_of_the_set_are_refused() -> None:
    name = houses_of_set(["bundled"], "design")[0].name
    assert [house.name for house in houses_of_set([name], "design")] == [name]
    with pytest.raises(SystemExit, match="no house of the held-out set"):
        houses_of_set([name], "held-out")


def test_a_house_has_the_same_views_whichever_others_are_measured() -> None:
    houses = houses_of_set(["bundled"], "held-out")[:2]
    both, second = list(views(houses, 8, 5)), list(views(houses[1:], 4, 5))
    assert [view.house for view in both[4:]] == [view.house for view in second]
    for one, other in zip(both[4:], second, strict=True):
        assert one.frame.pose == other.frame.pose
        assert one.truths == other.truths
        assert (one.rgb == other.rgb).all()
    assert both[4].frame.pose != next(views(houses[1:], 4, 6)).frame.pose


def test_objects_of_the_detectors_classes_that_fill_a_hundredth_count() -> None:
    for view in itertools.islice(views(houses_of_set(["bundled"], "held-out"), 12, 1), 12):
        for truth in view.truths:
            left, top, right, bottom = truth.box_px
            assert (right - left) * (bottom - top) > 0.01 * view.frame.depth_m.size
    assert set(CLASSES_OF_TYPE) <= set(PROCTHOR_TYPES)
    assert {name for names in CLASSES_OF_TYPE.values() for name in names} <= set(COCO_CLASSES)


class Found:
    """Finds the boxes that it is given."""

    def __init__(self, *boxes: tuple[str, float, tuple[int, int, int, int]]) -> None:
        names, confidences, boxes_px = zip(*boxes, strict=True)
        numbers = np.array([COCO_CLASSES.index(name) for name in names])
        self.boxes = Boxes(np.array(boxes_px, np.float32), numbers, np.array(confidences, np.float32))

    def detect(self, *_: object, **__: object) -> Boxes:
        return self.boxes


def test_a_box_finds_one_object_of_a_type_that_its_class_is_right_for() -> None:
    frame = Frame(
        Pose(0.0, 0.0, 0.0, 0.0),
        Intrinsics(100, 100, 1.5),
        np.ones((100, 100), np.float32),
        np.zeros((100, 100, 3), np.uint8),
    )
    truths = (
        Truth("Chair", (0, 0, 40, 40)),
        Truth("ArmChair", (50, 50, 90, 90)),
        Truth("Bed", (0, 50, 40, 90)),
        Truth("Chair", (0, 0, 38, 40)),
    )
    network = Found(
        ("chair", 0.9, (0, 0, 40, 41)),
        ("couch", 0.5, (52, 50, 90, 90)),
        ("couch", 0.4, (0, 50, 40, 90)),
        ("toilet", 0.3, (0, 0, 38, 40)),
    )
    found = measure_pictures.matched(network, PictureView("house", frame, truths))
    np.testing.assert_allclose(found, [0.9, 0.5, 0.0, 0.0], atol=1e-6)
    recalls = measure_pictures.recall_by_type(network, [PictureView("house", frame, truths)])
    assert {kind: (one.found(), len(one.confidences)) for kind, one in recalls.items()} == {
        "all": (2, 4),
        measure_pictures.WHOLE: (1, 1),
        "Chair": (1, 2),
        "ArmChair": (1, 1),
        "Bed": (0, 1),
    }


def test_statistics_of_pictures_that_are_known() -> None:
    flat = np.full((4, 4, 3), 100, np.uint8)
    striped = np.zeros((4, 4, 3), np.uint8)
    striped[:, 1::2, 0] = 200
    one = statistics_of([flat])
    assert (one.equal_neighbours, one.luminance, one.saturation) == (
        1.0,
        pytest.approx((100.0, 0.0), abs=1e-3),
        (0.0, 0.0),
    )
    both = statistics_of([flat, striped])
    assert both.equal_neighbours == 0.5
    # A step of red by 200 is one of 59.8 grey levels: the bin from 32 to 64.
    np.testing.assert_allclose(both.gradients, (0.5, 0, 0, 0, 0, 0, 0, 0.5, 0), atol=1e-9)
    assert both.saturation[0] == pytest.approx(0.25)
