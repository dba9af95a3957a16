"""Picks the views that `measure_pictures.py` measures: houses of two sets, poses by seed, objects with their boxes.

A house belongs to one of two sets by the hash of its content, whichever file it comes from. Pictures are designed while
looking at houses of the design set, and measured on houses of the held-out set.
"""

import hashlib
import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from evonav.house.files import HouseTexts
from evonav.perception.coco import TYPE_OF_CLASS
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.pose import Pose
from evonav.world.simulator import Frame, SimulatorConfig, Style

HouseSet = Literal["design", "held-out"]
SETS: tuple[HouseSet, ...] = get_args(HouseSet)
VIEWS_A_HOUSE = 4
"""Fewest views of a house; with few houses there are more."""
MIN_AREA = 0.01
"""Part of the picture that an object must fill."""

CLASSES_OF_TYPE: dict[str, tuple[str, ...]] = {
    **{kind: (name,) for name, kind in TYPE_OF_CLASS.items()},
    "ArmChair": ("chair", "couch"),
    "Mug": ("cup",),
    "WineBottle": ("bottle",),
}
"""COCO's classes that are right for a type. COCO's annotators call an armchair either."""


@dataclass(frozen=True)
class Looks:
    """Directions that the camera is drawn from."""

    horizons_deg: tuple[float, float] = (0.0, 30.0)
    """Least and greatest angle by which it looks down."""
    quarter_turns: bool = False
    """Whether yaws are multiples of 90 degrees."""

    def draw(self, rng: np.random.Generator) -> tuple[float, float]:
        """Return a yaw and a horizon in radians."""
        yaw_deg = 90.0 * int(rng.integers(4)) if self.quarter_turns else float(rng.uniform(0.0, 360.0))
        return math.radians(yaw_deg), math.radians(float(rng.uniform(*self.horizons_deg)))


ANYWHERE = Looks()
LIKE_RECORDED = Looks((30.0, 30.0), quarter_turns=True)
"""Directions of the recorded frames."""


@dataclass(frozen=True)
class NamedHouse:
    """A house of one of the sets."""

    name: str
    text: str
    digest: str

    @property
    def set(self) -> HouseSet:
        """The set that it belongs to, by its hash."""
        return SETS[int(self.digest[0], 16) % 2]


@dataclass(frozen=True)
class Truth:
    """An object that a detector should find."""

    type: str
    box_px: tuple[int, int, int, int]
    """Left, top, right, bottom of its mask."""

    def is_cut(self, side_px: int) -> bool:
        """Return whether it reaches the border of a square picture, so that a part of it may be missing."""
        left, top, right, bottom = self.box_px
        return min(left, top) == 0 or max(right, bottom) == side_px


@dataclass(frozen=True)
class PictureView:
    """A picture and the objects in it that count."""

    house: str
    frame: Frame
    truths: tuple[Truth, ...]

    @property
    def rgb(self) -> NDArray[np.uint8]:
        """Return the colours `(H, W, 3)`."""
        if self.frame.rgb is None:
            raise AssertionError("the views are rendered with colours")
        return self.frame.rgb


def houses_of_set(paths: Sequence[str], which: HouseSet) -> list[NamedHouse]:
    """Return the houses of a set in some files, each once, in the order of their hashes.

    Args:
        paths: House files, as for `evonav.load_houses`.
        which: The set.

    Raises:
        SystemExit: The files have no house of the set.
    """
    found: dict[str, NamedHouse] = {}
    for path in paths:
        for house in HouseTexts(path):
            canonical = json.dumps(json.loads(house.text), sort_keys=True)
            digest = hashlib.sha256(canonical.encode()).hexdigest()
            found.setdefault(digest, NamedHouse(house.name, house.text, digest))
    chosen = sorted((one for one in found.values() if one.set == which), key=lambda one: one.digest)
    if not chosen:
        raise SystemExit(f"{', '.join(paths)}: no house of the {which} set; name more files with --houses")
    return chosen


def fullest_views(
    houses: Sequence[NamedHouse], num_views: int, seed: int, *, style: Style = "default", looks: Looks = ANYWHERE
) -> list[PictureView]:
    """Return one view of each of some houses, with the most objects of several: for looking, not for measuring.

    Args:
        houses: Houses of the design set.
        num_views: Number of views; no more than there are houses.
        seed: Seed, as of `views`.
        style: Style that the simulator draws in.
        looks: Directions that the camera is drawn from.
    """
    some = houses[:num_views]
    best: dict[str, PictureView] = {}
    for view in views(some, 2 * VIEWS_A_HOUSE * len(some), seed, style=style, looks=looks):
        if view.house not in best or len(view.truths) > len(best[view.house].truths):
            best[view.house] = view
    return list(best.values())


def views(
    houses: Sequence[NamedHouse],
    num_views: int,
    seed: int,
    *,
    style: Style = "default",
    image_px: int = 300,
    looks: Looks = ANYWHERE,
) -> Iterator[PictureView]:
    """Yield views from places that the agent can stand at; a house has the same ones whichever others are measured.

    Args:
        houses: Houses of one set.
        num_views: Number of views, spread over the houses.
        seed: Seed of position, yaw and horizon.
        style: Style that the simulator draws in.
        image_px: Side of the square images.
        looks: Directions that the camera is drawn from.
    """
    some = houses[: max(1, -(-num_views // VIEWS_A_HOUSE))]
    config = SimulatorConfig(width_px=image_px, height_px=image_px, style=style)
    world = EmbeddedSimulator(config, allow_unknown_assets=True)
    for index, house in enumerate(some):
        rng = np.random.default_rng([seed, int(house.digest[:8], 16)])
        home = world.reset(house.text, name=house.name)
        positions_m = world.reachable_positions()
        for _ in range(num_views // len(some) + (index < num_views % len(some))):
            frame = world.render(_pose(rng, home, positions_m, looks))
            yield PictureView(house.name, frame, _truths(frame, [body.category for body in world.objects]))


def _pose(rng: np.random.Generator, home: Pose, positions_m: NDArray[np.float64], looks: Looks) -> Pose:
    x_m, _, z_m = positions_m[rng.integers(len(positions_m))].tolist()
    yaw_rad, horizon_rad = looks.draw(rng)
    return replace(home, x_m=x_m, z_m=z_m, yaw_rad=yaw_rad, horizon_rad=horizon_rad)


def _truths(frame: Frame, types: Sequence[str]) -> tuple[Truth, ...]:
    if frame.instances is None:
        raise AssertionError("the views are rendered with instances")
    areas_px = np.bincount(frame.instances.ravel(), minlength=len(types) + 1)
    found = []
    for index, kind in enumerate(types, 1):
        if kind in CLASSES_OF_TYPE and areas_px[index] > MIN_AREA * frame.instances.size:
            rows, cols = np.nonzero(frame.instances == index)
            box_px = (int(cols.min()), int(rows.min()), int(cols.max()) + 1, int(rows.max()) + 1)
            found.append(Truth(kind, box_px))
    return tuple(found)
