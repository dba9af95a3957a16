"""The default style: smooth edges, light that depends on the house alone, and form in what is dark."""

from dataclasses import replace
from itertools import islice
from typing import get_args

import numpy as np
import pytest
from numpy.typing import NDArray

from evonav.house import bundled_houses
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.pose import Pose
from evonav.world.simulator import SimulatorConfig, Style

CONFIG = SimulatorConfig(width_px=96, height_px=72, style="default")
HOUSES = [house.to_json() for house in islice(bundled_houses(), 3)]


def _poses(simulator: EmbeddedSimulator) -> list[Pose]:
    places = simulator.reachable_positions()
    chosen = places[:: len(places) // 4]
    return [Pose(*place, yaw_rad=1.3 * turn, horizon_rad=0.4) for turn, place in enumerate(chosen.tolist())]


def _colours(config: SimulatorConfig, house: str, poses: list[Pose]) -> NDArray[np.float64]:
    simulator = EmbeddedSimulator(config)
    simulator.reset(house)
    return np.stack([simulator.render(pose).rgb for pose in poses]).astype(np.float64)


@pytest.mark.parametrize("style", get_args(Style))
def test_smooth_edges_are_nearer_to_an_image_of_nine_samples_a_pixel_than_to_one(style: Style) -> None:
    """The style `plain` draws each pixel by its middle."""
    config = replace(CONFIG, style=style)
    simulator = EmbeddedSimulator(config)
    simulator.reset(HOUSES[0])
    poses = _poses(simulator)
    smooth = _colours(config, HOUSES[0], poses)
    fine = _colours(replace(config, width_px=288, height_px=216), HOUSES[0], poses)
    nine = fine.reshape(len(poses), 72, 3, 96, 3, 3).mean(axis=(2, 4))
    # The middle one of the nine samples is where the small image takes its only one.
    one = fine[:, 1::3, 1::3]
    is_edge = np.abs(nine - one).max(axis=-1) > 12
    assert is_edge.mean() > 0.01
    error, unsmoothed = (np.abs(image - nine)[is_edge].mean() for image in (smooth, one))
    if style == "plain":
        assert error == pytest.approx(unsmoothed, rel=0.05)
    else:
        assert error < 0.9 * unsmoothed


def test_light_depends_on_the_house_alone() -> None:
    simulator = EmbeddedSimulator(CONFIG)
    simulator.reset(HOUSES[1])
    poses = _poses(simulator)
    first = [simulator.render(pose).rgb for pose in poses]
    again = EmbeddedSimulator(CONFIG)
    again.reset(HOUSES[1])
    for pose, image in reversed(list(zip(poses, first, strict=True))):
        np.testing.assert_array_equal(again.render(pose).rgb, image)


def test_images_are_neither_black_nor_blown() -> None:
    for house in HOUSES:
        simulator = EmbeddedSimulator(CONFIG)
        simulator.reset(house)
        images = _colours(CONFIG, house, _poses(simulator))
        assert (images.max(axis=-1) < 8).mean() < 0.01
        assert (images.min(axis=-1) > 250).mean() < 0.05
        assert 60 < images.mean() < 170
