"""Edges in the style `default` against supersampled images; the style `plain` draws each pixel by its middle."""

import numpy as np
import pytest

from evonav.house import bundled_houses
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.pose import Pose
from evonav.world.simulator import SimulatorConfig, Style

SIDE_PX, FINER = 300, 5


def errors_at_edges(style: Style) -> tuple[float, float]:
    """Return the mean error of an image's pixels at borders of objects, and that of the middles of its pixels.

    The truth is the mean of 5 x 5 pixels of an image that is finer by that much; the middle one of them is what the
    middle of the pixel shows.
    """
    random = np.random.default_rng(0)
    coarse = EmbeddedSimulator(SimulatorConfig(width_px=SIDE_PX, height_px=SIDE_PX, style=style))
    fine_px = SIDE_PX * FINER
    fine = EmbeddedSimulator(SimulatorConfig(width_px=fine_px, height_px=fine_px, style=style))
    own, middles = [], []
    for house in list(bundled_houses())[::60]:
        for simulator in (coarse, fine):
            simulator.reset(house.to_json())
        places_m = coarse.reachable_positions()
        for place_m in places_m[random.choice(len(places_m), 4)]:
            pose = Pose(*place_m.tolist(), random.uniform(0.0, 2.0 * np.pi), 0.3)
            image, finer = coarse.render(pose), fine.render(pose)
            blocks = finer.rgb.reshape(SIDE_PX, FINER, SIDE_PX, FINER, 3).astype(np.float64)
            ids = finer.instances.reshape(SIDE_PX, FINER, SIDE_PX, FINER)
            is_edge = ids.max((1, 3)) != ids.min((1, 3))
            truth = blocks.mean((1, 3))
            own.append(np.abs(image.rgb - truth)[is_edge])
            middles.append(np.abs(blocks[:, FINER // 2, :, FINER // 2] - truth)[is_edge])
    return float(np.concatenate(own).mean()), float(np.concatenate(middles).mean())


def test_smooth_edges_are_nearer_to_supersampled_ones() -> None:
    own, middles = errors_at_edges("default")
    assert own < 0.75 * middles
    own, middles = errors_at_edges("plain")
    assert own == pytest.approx(middles, rel=0.05)
