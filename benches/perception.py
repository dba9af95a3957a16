"""Perception: simulated errors and the mini detector, compared with SciPy, NumPy, and rendering the same views."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from evonav import _core
from evonav.evaluation.run.components import Backend
from evonav.house import bundled_houses
from evonav.perception import Perception, StageScene
from evonav.perception.ground_truth import GroundTruthPerception
from evonav.perception.shorthand import parse_perception
from evonav.speed_benchmark.timing import Row, compare
from evonav.tasks.public import Goal
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.pose import Pose
from evonav.world.simulator import Frame

NOTES = """\
Rounds of three views of bundled houses, 300x300. *Margins*: every mask grows or shrinks by up to 2 pixels. *Depth*:
noise, steps, dropouts. The peer of a whole perception is the rendering of its views.
"""
NUM_HOUSES, ROUNDS_PER_HOUSE = 8, 3
NOISE = {"sigma_m": 0.0012, "sigma_per_m": 0.0014, "step_per_m": 0.0028, "dropout": 0.02, "edge_dropout": 0.5}
WORDS = ("gt", "noisy:good", "noisy:yolo-world-like", "noisy:poor", "predicted:mini")


@dataclass(frozen=True)
class Round:
    """Views from one place."""

    house: str
    simulator: EmbeddedSimulator
    poses: Sequence[Pose]
    frames: Sequence[Frame]
    masks: NDArray[np.int32]
    """Of the first view, numbered from 0."""


def run() -> list[Row]:
    """Times the kernels, then whole perceptions."""
    rounds = _rounds()
    houses = [one.house for one in rounds]
    draws = np.random.default_rng(0)
    margins = [draws.uniform(-2.0, 2.0, int(one.masks.max()) + 1) for one in rounds]
    depths = [one.frames[0].depth_m for one in rounds]

    def depth(number: int) -> object:
        return _core.noisy_depth(depths[number], **NOISE, max_depth_m=5.0, seed=0, labels=[str(number)])

    rows = compare(
        "margins of a view's masks",
        lambda number: _core.distort_masks(rounds[number].masks, _unchanged(margins[number]), margins[number]),
        {"scipy.ndimage": lambda number: _scipy_margins(rounds[number].masks, margins[number])},
        houses,
    )
    rows += compare(
        "noisy depth of a view", depth, {"numpy": lambda number: _numpy_depth(depths[number], draws)}, houses
    )
    for word in WORDS:
        perceive, needs_rgb = _perceiver(word, rounds)
        rows += compare(f"{word}, three views", perceive, {"rendering them": _renderer(rounds, needs_rgb)}, houses)
    return rows


def _rounds() -> list[Round]:
    draws = np.random.default_rng(0)
    rounds = []
    for house in bundled_houses(NUM_HOUSES):
        simulator = EmbeddedSimulator()
        start = simulator.reset(house.to_json(), name=house.name)
        places = simulator.reachable_positions()
        for x_m, _, z_m in draws.permutation(places)[:ROUNDS_PER_HOUSE].tolist():
            yaw_rad = float(draws.uniform(-math.pi, math.pi))
            ahead = replace(start, x_m=x_m, z_m=z_m, horizon_rad=math.radians(30.0))
            poses = [replace(ahead, yaw_rad=yaw_rad + math.radians(turn)) for turn in (-60.0, 60.0, 0.0)]
            frames = [simulator.render(pose) for pose in poses]
            masks = GroundTruthPerception().detect(frames[0], simulator.objects).masks
            if masks.max() >= 0:
                rounds.append(Round(house.name or "", simulator, poses, frames, masks))
    return rounds


def _perceiver(word: str, rounds: Sequence[Round]) -> tuple[Callable[[int], object], bool]:
    """What perceives round `i`, and whether it needs colours."""
    backend = Backend(perception=parse_perception(word))
    goal = Goal(1, "Bed", "the bed", "the bed", "Find the bed.", np.zeros((300, 300, 3), np.uint8))
    perceptions: list[Perception] = []
    for number, one in enumerate(rounds):
        perception = backend.perception.create()
        perception.begin_stage(StageScene(str(number), goal, "fu", 0, one.simulator.objects))
        perceptions.append(perception)
    return (lambda number: perceptions[number].perceive(rounds[number].frames)), perceptions[0].needs_rgb


def _renderer(rounds: Sequence[Round], needs_rgb: bool) -> Callable[[int], object]:
    return lambda number: [rounds[number].simulator.render(pose, rgb=needs_rgb) for pose in rounds[number].poses]


def _unchanged(margins_px: NDArray[np.float64]) -> NDArray[np.int32]:
    """Changes that leave everything but the margins."""
    most = np.iinfo(np.int32).max
    numbers = np.arange(len(margins_px))
    fixed = np.tile(np.array([0, most, 0, 0, most, most]), (len(margins_px), 1))
    return np.column_stack([numbers, numbers, fixed]).astype(np.int32)


def _scipy_margins(masks: NDArray[np.int32], margins_px: NDArray[np.float64]) -> NDArray[np.int32]:
    found = masks.copy()
    for number, margin_px in enumerate(margins_px.tolist()):
        reach = math.floor(abs(margin_px))
        rows, cols = np.mgrid[-reach : reach + 1, -reach : reach + 1]
        disk, mask = rows**2 + cols**2 <= margin_px**2, masks == number
        if margin_px > 0:
            found[ndimage.binary_dilation(mask, disk) & ~mask] = number
        else:
            found[mask & ~ndimage.binary_erosion(mask, disk, border_value=1)] = -1
    return found


def _numpy_depth(depth_m: NDArray[np.float32], draws: np.random.Generator) -> NDArray[np.float32]:
    is_far = ~(depth_m <= 5.0)
    depth_m = np.where(is_far, np.float32(5.0), depth_m)
    square = depth_m**2
    found = depth_m + draws.standard_normal(depth_m.shape, np.float32) * (
        NOISE["sigma_m"] + NOISE["sigma_per_m"] * square
    )
    step = NOISE["step_per_m"] * square
    found = np.round(found / step) * step
    jump = ndimage.maximum_filter(depth_m, 3) - ndimage.minimum_filter(depth_m, 3)
    chance = np.where(jump > 0.05 * depth_m, NOISE["edge_dropout"], NOISE["dropout"])
    found[(draws.random(depth_m.shape, np.float32) < chance) | is_far] = np.inf
    return found.astype(np.float32)
