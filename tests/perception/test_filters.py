"""Filters of detections: cases worked out by hand."""

import numpy as np
import pytest

from evonav.errors import InvalidArgumentError
from evonav.perception.detector import Found
from evonav.perception.filters import (
    FilterConfig,
    box_areas_px,
    filtered,
    joined,
    mask_ious,
    one_label_a_pixel,
    without_contained,
    without_doubles,
    without_small_and_doubtful,
    without_specks_and_giants,
)

# 128x128 images: a tenth of 3D-Mem's side, so 20 px are 2 px and 25 px are a quarter of one.
SIDE = 128
CONFIG = FilterConfig()


def found(*parts: tuple[tuple[int, int, int, int], float, str]) -> Found:
    """Masks that fill their boxes (left, top, right, bottom)."""
    masks = np.zeros((len(parts), SIDE, SIDE), np.bool_)
    for mask, ((left, top, right, bottom), _, _) in zip(masks, parts, strict=True):
        mask[top:bottom, left:right] = True
    return Found(
        masks,
        np.array([box for box, _, _ in parts], np.float32).reshape(-1, 4),
        tuple(label for _, _, label in parts),
        np.array([confidence for _, confidence, _ in parts], np.float32),
    )


def test_small_doubtful_and_background_detections_go_and_the_rest_is_sorted() -> None:
    kept = without_small_and_doubtful(
        found(
            ((0, 0, 16, 1), 0.9, "speck"),  # 16 px are less than 0.1 % of 16,384 px
            ((0, 0, 17, 1), 0.5, "crumb"),  # 17 px are more
            ((20, 20, 40, 40), 0.39, "doubtful"),
            ((20, 20, 40, 40), 0.4001, "chair"),
            ((20, 20, 40, 40), 0.95, "rug"),
            ((50, 50, 60, 60), 0.8, "table"),
        ),
        CONFIG,
    )
    assert kept.labels == ("table", "crumb", "chair")


def test_of_two_nearly_equal_masks_the_more_confident_stays() -> None:
    # 19x20 of 20x20 pixels: IoU 0.95. Middles half a pixel apart, but the masks decide first: the larger one goes.
    kept = without_doubles(found(((20, 20, 39, 40), 0.9, "bed"), ((20, 20, 40, 40), 0.8, "sofa")), CONFIG)
    assert kept.labels == ("bed",)
    # 18x20: IoU 0.9 exactly is not above it; middles 1 px apart are nearer than 2 px: the larger box stays.
    kept = without_doubles(found(((20, 20, 38, 40), 0.9, "bed"), ((20, 20, 40, 40), 0.8, "sofa")), CONFIG)
    assert kept.labels == ("sofa",)


def test_of_boxes_around_one_middle_the_larger_stays() -> None:
    small, large = ((30, 30, 40, 40), 0.9, "vase"), ((20, 20, 50, 50), 0.8, "table")
    assert without_doubles(found(small, large), CONFIG).labels == ("table",)
    assert without_doubles(found(large, small), CONFIG).labels == ("table",)
    beside = ((23, 20, 53, 50), 0.8, "table")  # its middle is 3 px from the vase's
    assert without_doubles(found(small, beside), CONFIG).labels == ("vase", "table")


def test_a_box_of_equal_size_does_not_replace_and_one_must_beat_all_its_rivals() -> None:
    a, b = ((20, 20, 40, 40), 0.9, "a"), ((21, 20, 41, 40), 0.8, "b")
    assert without_doubles(found(a, b), CONFIG).labels == ("a",)
    # Middles at 30, 33 and 31.5: the third is near both, larger than the first and smaller than the second.
    first, second = ((26, 26, 34, 34), 0.9, "first"), ((23, 20, 43, 40), 0.8, "second")
    third = ((27, 25, 36, 35), 0.7, "third")
    assert without_doubles(found(first, second, third), CONFIG).labels == ("first", "second")


def test_the_distance_of_middles_grows_with_the_image() -> None:
    near = ((20, 20, 40, 40), 0.9, "a"), ((25, 20, 44, 40), 0.8, "b")  # 4.5 px apart
    assert without_doubles(found(*near), CONFIG).labels == ("a", "b")
    original = FilterConfig(reference_px=(SIDE, SIDE))
    assert without_doubles(found(*near), original).labels == ("a",)


def test_specks_and_boxes_over_half_the_image_go() -> None:
    parts = (
        ((0, 0, 64, 128), 0.9, "half"),
        ((0, 0, 65, 128), 0.9, "more"),
        ((0, 0, 1, 1), 0.9, "1"),
        ((0, 0, 6, 4), 0.9, "24"),
        ((0, 0, 5, 5), 0.9, "25"),
    )
    assert without_specks_and_giants(found(*parts), CONFIG).labels == ("half", "1", "24", "25")
    original = FilterConfig(reference_px=(SIDE, SIDE))
    assert without_specks_and_giants(found(*parts), original).labels == ("half", "25")


def test_a_contained_mask_is_taken_off_the_one_that_it_is_on() -> None:
    sofa, pillow = ((10, 10, 50, 50), 0.9, "sofa"), ((40, 20, 52, 30), 0.8, "pillow")
    # They share 10x10 px: 100/1600 of the sofa's box, 100/120 = 0.83 of the pillow's.
    kept = without_contained(found(sofa, pillow), CONFIG)
    assert np.count_nonzero(kept.masks, axis=(1, 2)).tolist() == [1500, 120]
    assert not (kept.masks[0] & kept.masks[1]).any()
    # 9x10 of 120 px are 0.75: not contained. And 30x40 of 40x40 are 0.75 of the sofa's: the same thing, not on it.
    apart = without_contained(found(sofa, ((41, 20, 53, 30), 0.8, "pillow")), CONFIG)
    assert np.count_nonzero(apart.masks, axis=(1, 2)).tolist() == [1600, 120]
    same = without_contained(found(sofa, ((10, 10, 40, 50), 0.8, "couch")), CONFIG)
    assert np.count_nonzero(same.masks, axis=(1, 2)).tolist() == [1600, 1200]


def test_a_mask_that_loses_everything_goes() -> None:
    outer, inner = found(((10, 10, 50, 50), 0.9, "outer")), found(((12, 12, 30, 30), 0.8, "inner"))
    both = Found(
        np.concatenate([inner.masks, inner.masks]),
        np.concatenate([outer.boxes_px, inner.boxes_px]),
        ("outer", "inner"),
        np.array([0.9, 0.8], np.float32),
    )
    assert without_contained(both, CONFIG).labels == ("inner",)


def test_all_filters_in_their_order() -> None:
    kept = filtered(
        found(
            ((60, 60, 66, 66), 0.5, "cup"),
            ((40, 40, 90, 90), 0.7, "table"),
            ((0, 0, 128, 110), 0.99, "room"),
            ((0, 0, 128, 60), 0.99, "wall"),
            ((40, 40, 90, 89), 0.45, "desk"),
        ),
        CONFIG,
    )
    assert kept.labels == ("table", "cup")
    assert np.count_nonzero(kept.masks, axis=(1, 2)).tolist() == [2464, 36]


def test_nothing_is_left_of_nothing() -> None:
    nothing = found()
    assert filtered(nothing, CONFIG).labels == ()
    assert (one_label_a_pixel(nothing.masks) == -1).all()
    assert joined(nothing, nothing, 0.5).labels == ()


def test_a_pixel_goes_to_the_smaller_mask_and_of_equal_ones_to_the_first() -> None:
    parts = found(((0, 0, 10, 10), 0.9, "small"), ((5, 5, 25, 25), 0.8, "large"), ((0, 0, 10, 10), 0.7, "again"))
    image = one_label_a_pixel(parts.masks)
    assert image[7, 7] == 0
    assert image[20, 20] == 1
    assert (image != 2).all()
    assert image[60, 60] == -1


def test_what_two_detectors_found_is_once_there_as_the_first_has_it() -> None:
    first = found(((10, 10, 30, 30), 0.6, "couch"))
    second = found(((10, 10, 30, 32), 0.9, "sofa"), ((60, 60, 80, 80), 0.5, "painting"))
    assert joined(first, second, 0.5).labels == ("couch", "painting")
    assert joined(first, second, 0.95).labels == ("couch", "sofa", "painting")


def test_areas_and_overlaps_by_count() -> None:
    parts = found(((0, 0, 4, 4), 1.0, "a"), ((2, 0, 6, 4), 1.0, "b"), ((5, 5, 2, 9), 1.0, "inside out"))
    assert mask_ious(parts.masks)[0, 1] == pytest.approx(8 / 24)
    assert mask_ious(parts.masks)[2, 2] == 0.0  # an empty mask
    assert box_areas_px(parts.boxes_px).tolist() == [16.0, 16.0, 0.0]


@pytest.mark.parametrize("values", [{"min_confidence": 1.5}, {"min_area_px": float("nan")}, {"reference_px": (0, 10)}])
def test_a_filter_without_sense_is_refused(values: dict) -> None:
    with pytest.raises(InvalidArgumentError, match=next(iter(values))):
        FilterConfig(**values)
