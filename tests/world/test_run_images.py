"""Images of numbers that are stored as runs, and arrays to those who look at them."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

from evonav import _core
from evonav._core import RunImage
from evonav.errors import InvalidArgumentError
from evonav.sensors.observation import Detections
from evonav.world.run_images import unexpanded

MASKS = np.array([[-1, 0, 0, 1], [1, 1, -1, -1], [0, 0, 0, 0]], np.int32)


def detections() -> Detections:
    return Detections(unexpanded(RunImage.of(MASKS)), ("Sofa", "Bed"), np.ones(2, np.float32))


def test_an_image_of_runs_has_their_pixels() -> None:
    image = RunImage.of(MASKS)
    assert image.shape == (3, 4)
    assert image.ends.tolist() == [[1, -1], [3, 0], [4, 1], [6, 1], [8, -1], [12, 0]]
    np.testing.assert_array_equal(image.pixels(), MASKS)
    assert RunImage(image.shape, image.ends) == image == pickle.loads(pickle.dumps(image))


@pytest.mark.parametrize("ends", [[[3, 0]], [[3, 0], [5, 1], [12, 0]], [[0, 1], [12, 0]], [[13, 0]], []])
def test_runs_that_are_no_image_are_refused(ends: list[list[int]]) -> None:
    with pytest.raises(InvalidArgumentError, match="runs"):
        RunImage((3, 4), np.array(ends, np.int32).reshape(-1, 2))


def test_runs_are_expanded_when_somebody_looks_and_then_the_array_counts() -> None:
    found = detections()
    assert type(found.stored_masks) is RunImage
    np.testing.assert_array_equal(found.masks, MASKS)
    found.masks[0, 0] = 1  # agents may write
    assert found.stored_masks is found.masks
    assert _core.mask_extents(found.stored_masks, num_masks=2)[1].tolist() == [4, 0, 0, 4, 2]


def test_arrays_stay_as_they_were_given() -> None:
    found = Detections(MASKS, ("Sofa", "Bed"), np.ones(2, np.float32))
    assert found.masks is MASKS
    assert found.stored_masks is MASKS


def test_copies_have_the_same_masks() -> None:
    for copy in (replace(detections(), labels=("Chair", "Bed")), pickle.loads(pickle.dumps(detections()))):
        np.testing.assert_array_equal(copy.masks, MASKS)


def test_the_core_takes_both_forms() -> None:
    image, numbers = RunImage.of(MASKS), np.array([5, -1], np.int32)
    assert _core.renumber_masks(image, numbers) == _core.renumber_masks(MASKS, numbers)
    np.testing.assert_array_equal(_core.mask_extents(image, num_masks=2), _core.mask_extents(MASKS, num_masks=2))
    np.testing.assert_array_equal(_core.instance_areas(RunImage.of(MASKS + 1), 2), [6, 3])
