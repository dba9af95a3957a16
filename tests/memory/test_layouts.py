"""The colours around a place in an image, and how far apart two of them are."""

import math

import numpy as np
import pytest
from test_colours import seen

from evonav.errors import InvalidArgumentError
from evonav.memory.colours import NEAR, STRIDE_PX, _names, distance, layouts
from evonav.memory.views import ViewStore
from evonav.tasks.language import COLOURS

WHITE, RED = (190, 190, 190), (150, 20, 20)


def layouts_naive(rgb: np.ndarray, place_px: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Add up pixel by pixel."""
    near, whole = np.zeros(len(COLOURS)), np.zeros(len(COLOURS))
    total, num = 0.0, 0
    for row in range(0, rgb.shape[0], STRIDE_PX):
        for col in range(0, rgb.shape[1], STRIDE_PX):
            red, green, blue = (
                int(min(float(np.float32(one) * np.float32(1.3)), 255.0)) // 16 for one in rgb[row, col]
            )
            named = _names()[(red * 16 + green) * 16 + blue].astype(np.float64)
            apart = math.hypot(col - place_px[0], row - place_px[1]) / (NEAR * rgb.shape[0])
            weight = math.exp(-0.5 * apart**2)
            near, whole = near + weight * named, whole + named
            total, num = total + weight, num + 1
    return near / total, whole / num


@pytest.mark.parametrize("seed", range(4))
def test_layouts_are_weighted_sums_of_names(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rgb = rng.integers(0, 256, (*rng.integers(20, 50, 2), 3), dtype=np.uint8)
    places_px = [(float(x), float(y)) for x, y in rng.uniform(0, 50, (3, 2))]
    for place_px, found in zip(places_px, layouts(rgb, places_px), strict=True):
        near, whole = layouts_naive(rgb, place_px)
        assert found.near == pytest.approx(near, abs=1e-5)
        assert found.whole == pytest.approx(whole, abs=1e-5)
    assert layouts(rgb, []) == []


def test_what_is_near_counts_most() -> None:
    rgb = np.full((60, 120, 3), WHITE, np.uint8)
    rgb[:, 60:] = RED
    left, right = layouts(rgb, [(20.0, 30.0), (100.0, 30.0)])
    assert COLOURS[int(np.argmax(left.near))] == "white"
    assert COLOURS[int(np.argmax(right.near))] == "red"
    assert left.whole == right.whole


def test_distances_are_0_for_the_same_and_1_without_a_common_colour() -> None:
    one, other = (0.5, 0.5, 0.0, 0.0), (0.0, 0.0, 0.3, 0.7)
    assert distance(one, one) == pytest.approx(0.0, abs=1e-7)
    assert distance(one, other) == 1.0
    assert distance(one, (0.5, 0.0, 0.5, 0.0)) == pytest.approx(math.sqrt(0.5))


def test_views_keep_layouts_around_the_middles_of_boxes_only_if_asked() -> None:
    view = seen(WHITE, RED)
    kept = ViewStore(names_colours=True, keeps_layouts=True).add(view, [0, 1], stage=1, round_=0)
    assert view.rgb is not None
    assert [one.layout for one in kept.seen] == layouts(view.rgb, [(10.0, 10.0), (30.0, 10.0)])
    assert [one.layout for one in ViewStore(names_colours=True).add(view, [0, 1], stage=1, round_=0).seen] == [None] * 2
    with pytest.raises(InvalidArgumentError, match="needs_rgb"):
        ViewStore(keeps_layouts=True).add(seen(WHITE, with_rgb=False), [0], stage=1, round_=0)
