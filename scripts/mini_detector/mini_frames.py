"""Renders the frames that the mini detector learns from and is measured on: `frames(...)`, used by `train_mini.py`.

A frame is what an agent sees in a house as it stands in some stage of a task: half of the poses anywhere on the
reachable floor, half of them in front of an object.
"""

import gzip
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evonav.world.embedded import EmbeddedSimulator
from evonav.world.pose import Pose
from evonav.world.simulator import SimulatorConfig, Style

NEAR_OBJECT_M = (0.5, 2.2)
STYLE: Style = "default"
"""The style of the frames that the bundled weights were trained on."""
TILTS_RAD = (math.radians(-5), math.radians(35))


@dataclass(frozen=True)
class LabelledFrame:
    """A picture and what is in it."""

    house: str
    rgb: NDArray[np.uint8]
    depth_m: NDArray[np.float32]
    instances: NDArray[np.uint8]
    """`(H, W)`: 0 where no object is, else 1 + place in `labels`."""
    labels: tuple[str, ...]
    horizon_rad: float


def house_files(folder: Path) -> list[list[Path]]:
    """Of every task below a folder, its stages' houses."""
    return [sorted((task.parent / "houses").glob("*.json.gz")) for task in sorted(folder.glob("**/task.json"))]


def frames(tasks: list[list[Path]], num_per_house: int, seed: int, tilted: float = 0.0) -> Iterator[LabelledFrame]:
    """Frames of one stage's house of each task.

    Args:
        tasks: As `house_files` finds them.
        num_per_house: Frames of each house.
        seed: Of everything random.
        tilted: Share of views whose camera looks down by any of `TILTS_RAD` instead of as the house has it.
    """
    simulator = EmbeddedSimulator(SimulatorConfig(style=STYLE), allow_unknown_assets=True)
    for index, stages in enumerate(tasks):
        rng = np.random.default_rng([seed, index])
        stage = stages[int(rng.integers(len(stages)))]
        home = simulator.reset(gzip.decompress(stage.read_bytes()).decode(), name=str(stage))
        positions_m = simulator.reachable_positions()
        bodies = [body for body in simulator.objects if body.kind == "object"]
        for _ in range(num_per_house):
            pose = _anywhere(rng, positions_m, home)
            if bodies and rng.random() < 0.5:
                pose = _before_object(rng, positions_m, bodies[int(rng.integers(len(bodies)))].centre_m, home) or pose
            if tilted and rng.random() < tilted:
                pose = replace(pose, horizon_rad=float(rng.uniform(*TILTS_RAD)))
            yield _labelled(simulator, pose, stage.parent.parent.name)


def _anywhere(rng: np.random.Generator, positions_m: NDArray[np.float64], home: Pose) -> Pose:
    x_m, _, z_m = positions_m[rng.integers(len(positions_m))].tolist()
    return replace(home, x_m=x_m, z_m=z_m, yaw_rad=math.radians(float(rng.uniform(0, 360))))


def _before_object(
    rng: np.random.Generator, positions_m: NDArray[np.float64], centre_m: tuple[float, float, float], home: Pose
) -> Pose | None:
    distances_m = np.hypot(positions_m[:, 0] - centre_m[0], positions_m[:, 2] - centre_m[2])
    near = np.flatnonzero((distances_m >= NEAR_OBJECT_M[0]) & (distances_m <= NEAR_OBJECT_M[1]))
    if not len(near):
        return None
    x_m, _, z_m = positions_m[near[rng.integers(len(near))]].tolist()
    yaw_rad = math.atan2(centre_m[0] - x_m, centre_m[2] - z_m) + math.radians(float(rng.uniform(-35, 35)))
    return replace(home, x_m=x_m, z_m=z_m, yaw_rad=yaw_rad)


def _labelled(simulator: EmbeddedSimulator, pose: Pose, house: str) -> LabelledFrame:
    frame = simulator.render(pose)
    if frame.rgb is None or frame.instances is None:
        raise AssertionError("the simulator renders what it is asked for")
    objects = simulator.objects
    seen = [i for i in np.unique(frame.instances).tolist() if i > 0 and objects[i - 1].kind == "object"][:255]
    number = np.zeros(len(objects) + 1, np.uint8)
    number[seen] = np.arange(1, len(seen) + 1)
    labels = tuple(objects[i - 1].category for i in seen)
    return LabelledFrame(house, frame.rgb, frame.depth_m, number[frame.instances], labels, pose.horizon_rad)
