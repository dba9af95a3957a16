"""Spread a target that was never seen over the floor, or over the supports that the text names."""

import math
from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

from evonav import _core
from evonav.agents.grid import CoarseFrame, box_slices
from evonav.agents.proactive.config import ProactiveConfig
from evonav.agents.proactive.sightings import FarSighting
from evonav.decision.candidates import ObjectCandidate
from evonav.decision.home_statistics import PER_100_M2, UNKNOWN_PER_100_M2
from evonav.decision.text.language import ParsedGoal, canonical, is_structure, similarity

MIN_MASK_SHARE = 0.001
"""Smallest share of an image that a mask covers if it counts as a detection: 3D-Mem's filter, which the paper keeps."""
LOOK_DOWN_RAD, DROP_M = math.radians(30.0), 0.8
"""Angle under which a small thing is seen, and its usual distance below the camera."""


@cache
def visible_range_m(noun: str) -> float:
    """Return the distance on the ground plane up to which a usual object of a type is large enough to be detected.

    Returns:
        Metres, for a camera with a field of view of 90 degrees; `inf` for a type without a known size.
    """
    sizes_m = np.array([size_m for _, category, size_m in _core.assets() if canonical(category) == noun])
    if len(sizes_m) == 0:
        return math.inf
    width_m, height_m, depth_m = np.median(sizes_m, axis=0).tolist()
    side_m2 = 0.5 * (width_m + depth_m) * height_m
    shown_m2 = side_m2 * math.cos(LOOK_DOWN_RAD) + width_m * depth_m * math.sin(LOOK_DOWN_RAD)
    range_m = math.sqrt(shown_m2 / (4.0 * MIN_MASK_SHARE))
    return math.sqrt(max(range_m**2 - DROP_M**2, 0.0))


def density_of(noun: str) -> float:
    """Return the usual number of objects of a type on a square metre."""
    return PER_100_M2.get(noun, UNKNOWN_PER_100_M2) / 100.0


def prior_of(
    goal: ParsedGoal,
    remembered: Sequence[ObjectCandidate],
    sightings: Sequence[FarSighting],
    coarse: CoarseFrame,
    unknown: NDArray[np.bool_],
    config: ProactiveConfig,
) -> tuple[NDArray[np.float64], list[tuple[FarSighting, float]]]:
    """Return how many objects of the goal's type are to be expected at each place, weighted by how they fit the text.

    Args:
        sightings: Everything that was detected and is no entry.
        unknown: `(R, C)` coarse cells that the map does not know.

    Returns:
        `(R, C)` expected numbers. Without a support in the text, they are the same in all cells. With one, most of
        their sum is shared equally by all supports of that type: those that are remembered or were seen from afar,
        and those that the unknown area should hold. And the supports that were seen from afar, each with its share.
    """
    frame = coarse.frame
    cell_m2 = frame.cell_m**2
    expected = np.full((frame.rows, frame.cols), density_of(goal.noun) * cell_m2)
    leads: list[tuple[FarSighting, float]] = []
    relations = [one for one in goal.relations if one.kind != "in" and not is_structure(one.noun)]
    if not config.uses_anchors:
        return expected, leads
    supports = [one.noun for one in relations if one.kind == "on"][:1]
    for noun in supports:
        known = [one for one in remembered if similarity(noun, one.label) >= 1.0]
        afar = [one for one in sightings if similarity(noun, one.label) >= 1.0]
        unseen_per_cell = density_of(noun) * cell_m2
        number = len(known) + len(afar) + unseen_per_cell * float(unknown.sum())
        share = config.on_support * float(expected.sum()) / max(number, config.min_supports)
        expected *= 1.0 - config.on_support
        expected[unknown] += share * unseen_per_cell
        for one in known:
            box = box_slices(one, frame, 0.0)
            expected[box] += share / max(1, expected[box].size)
        leads = [(one, share) for one in afar]
    for relation in relations:
        if relation.noun in supports:
            continue
        near = np.zeros(expected.shape, np.bool_)
        for one in remembered:
            if similarity(relation.noun, one.label) >= 1.0:
                near[box_slices(one, frame, config.anchor_m)] = True
        total = float(expected.sum())
        expected[near] *= config.anchor_ratio
        expected *= total / float(expected.sum())
    return expected, leads
