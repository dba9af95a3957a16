"""The words for the colours that an agent saw, in detections and around places of an image."""

import math
from pathlib import Path

import numpy as np
import pytest

import evonav
from evonav.decision.text.language import parse_goal
from evonav.errors import InvalidArgumentError
from evonav.memory.colours import NEAR, STRIDE_PX, _names, colour_shares, distance, layouts
from evonav.memory.views import ViewStore
from evonav.sensors.observation import Detections, View
from evonav.tasks import load_tasks
from evonav.tasks.language import COLOURS
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.pose import Pose
from evonav.world.simulator import Intrinsics

MIN_SHARE = 0.85
"""Smallest share of the goals whose first colour must be among the first two of their picture."""


def seen(*colours: tuple[int, int, int], with_rgb: bool = True) -> View:
    """Return a view with a square of 20 px for each colour, side by side."""
    masks = np.repeat(np.arange(len(colours), dtype=np.int32), 20)[None].repeat(20, axis=0)
    rgb = np.array(colours, dtype=np.uint8)[masks]
    num = len(colours)
    return View(
        pose=Pose(0.0, 0.9, 0.0, 0.0),
        intrinsics=Intrinsics(20 * num, 20, 1.57),
        depth_m=np.ones(masks.shape, dtype=np.float32),
        detections=Detections(masks, ("Mug",) * num, np.ones(num, dtype=np.float32), None),
        occupancy=None,  # type: ignore[arg-type]
        rgb=rgb if with_rgb else None,
    )


def test_each_detection_has_the_shares_of_its_colours() -> None:
    shares = colour_shares(seen((190, 190, 190), (20, 20, 20), (20, 60, 150), (150, 20, 20)))
    assert [COLOURS[row.argmax()] for row in shares] == ["white", "black", "blue", "red"]
    assert shares.sum(axis=1) == pytest.approx(1.0, abs=1e-5)


def test_a_view_without_colours_is_refused() -> None:
    with pytest.raises(InvalidArgumentError, match="needs_rgb"):
        colour_shares(seen((0, 0, 0), with_rgb=False))


def test_views_are_kept_by_the_names_of_their_colours_in_place_of_images() -> None:
    views = ViewStore(names_colours=True)
    stored = views.add(seen((190, 190, 190)), [0], stage=1, round_=0)
    colours = stored.seen[0].colours
    assert stored.jpeg is None
    assert colours is not None
    assert max(colours) == colours[COLOURS.index("white")]
    assert ViewStore().add(seen((190, 190, 190)), [0], stage=1, round_=0).seen[0].colours is None


def test_the_three_views_that_show_an_entry_largest_are_kept_also_when_entries_merge() -> None:
    views = ViewStore()
    for count in (1, 4, 2, 3, 5):
        views.add(seen(*[(0, 0, 0)] * count), [count % 2] * count, stage=1, round_=0)
    assert [view.id for view, _ in views.largest(1)] == [0, 3, 3]
    views.follow([(0, 1)])
    assert len(views.largest(1)) == 3
    assert views.best(1) == views.largest(1)[0]


def test_the_describers_first_colour_is_among_the_first_two_that_are_seen() -> None:
    simulator = EmbeddedSimulator()
    hits = []
    for task in load_tasks(Path(evonav.__file__).parent / "data" / "tasks", limit=12):
        for k, oracle in enumerate(task.oracle_stages):
            words = parse_goal(task.public_stages[k].unified_instruction, oracle.target.category).adjectives
            named = [word for word in words if word in COLOURS]
            if not named:
                continue
            simulator.reset(task.houses_json[k])
            number = [body.id for body in simulator.objects].index(oracle.target.id) + 1
            frame = simulator.render(oracle.reference_pose.pose())
            masks = np.where(frame.instances == number, 0, -1).astype(np.int32)
            detections = Detections(masks, ("Target",), np.ones(1, dtype=np.float32), None)
            view = View(frame.pose, frame.intrinsics, frame.depth_m, detections, None, frame.rgb)  # type: ignore[arg-type]
            best = np.argsort(-colour_shares(view)[0])[:2]
            hits.append(named[0] in {COLOURS[i] for i in best})
    assert len(hits) > 30
    assert np.mean(hits) >= MIN_SHARE


# Around a place in an image


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
