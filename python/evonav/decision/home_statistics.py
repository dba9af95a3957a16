"""Statistics of homes, the common knowledge of rules and agents.

Colours, numbers and sizes are counted in the 151 bundled homes, of which only the bundled tasks are; rooms in the homes
that `OF_TYPE` names.
"""

from functools import cache

import numpy as np

from evonav import _core
from evonav.decision.text.language import canonical
from evonav.tasks.language import COLOURS

COLOUR_PRIOR = dict(
    zip(
        COLOURS,
        (0.087, 0.06, 0.371, 0.026, 0.001, 0.016, 0.045, 0.041, 0.003, 0.02, 0.277, 0.054),
        strict=True,
    )
)
"""Mean share of each colour in objects, each type counting alike."""

ROOM_ORDER = ("bedroom", "kitchen", "living room", "bathroom")
"""Order of the numbers of a type's rooms."""
OF_TYPE: dict[str, tuple[float, tuple[float, float, float, float] | None]] = {
    "alarm clock": (0.62, (2.53, 0.06, 0.06, 0.06)),
    "apple": (0.53, (0.07, 4.37, 0.07, 0.07)),
    "arm chair": (0.74, (1.72, 0.04, 1.36, 0.04)),
    "baseball bat": (0.81, (2.56, 0.05, 0.05, 0.05)),
    "basket ball": (0.7, (2.54, 0.06, 0.06, 0.06)),
    "bed": (1.32, (2.59, 0.03, 0.03, 0.03)),
    "book": (3.22, (1.67, 0.52, 1.04, 0.01)),
    "boots": (0.04, (1.61, 0.44, 0.90, 0.44)),
    "bottle": (0.23, (0.17, 4.02, 0.17, 0.17)),
    "bowl": (1.58, (1.02, 1.18, 1.46, 0.03)),
    "box": (0.99, (1.66, 0.04, 1.46, 0.04)),
    "bread": (0.39, (0.10, 4.28, 0.10, 0.10)),
    "butter knife": (0.46, (0.07, 4.36, 0.07, 0.07)),
    "candle": (0.99, (0.04, 0.04, 2.21, 2.73)),
    "cart": (0.18, (0.16, 0.16, 3.63, 0.16)),
    "cd": (0.56, (2.53, 0.07, 0.07, 0.07)),
    "cell phone": (1.83, (1.43, 0.50, 1.42, 0.02)),
    "chair": (3.98, (1.22, 1.23, 1.11, 0.01)),
    "cloth": (0.54, (0.43, 0.08, 0.08, 4.94)),
    "clothes dryer": (0.11, (0.24, 0.24, 0.24, 4.95)),
    "coffee machine": (0.23, (0.14, 4.11, 0.14, 0.14)),
    "coffee table": (0.05, (1.61, 0.44, 0.90, 0.44)),
    "countertop": (0.74, (0.05, 4.44, 0.05, 0.05)),
    "credit card": (1.08, (1.37, 0.77, 1.27, 0.04)),
    "cup": (0.34, (0.09, 4.30, 0.09, 0.09)),
    "desk": (0.28, (2.39, 0.15, 0.15, 0.15)),
    "desk lamp": (1.02, (1.64, 0.04, 1.48, 0.04)),
    "desktop": (0.01, None),
    "dining table": (1.92, (0.71, 0.80, 2.28, 0.02)),
    "dish sponge": (0.68, (0.05, 1.80, 0.05, 3.58)),
    "dog bed": (0.3, (1.56, 0.11, 1.52, 0.11)),
    "dresser": (1.44, (2.17, 0.03, 0.42, 0.42)),
    "dumbbell": (0.05, None),
    "egg": (1.17, (0.03, 4.51, 0.03, 0.03)),
    "faucet": (1.93, (0.02, 0.66, 0.02, 5.20)),
    "floor lamp": (0.69, (1.66, 0.05, 1.45, 0.05)),
    "fork": (0.31, (0.09, 4.29, 0.09, 0.09)),
    "fridge": (0.78, (0.05, 4.44, 0.05, 0.05)),
    "garbage bag": (0.24, (0.14, 4.13, 0.14, 0.14)),
    "garbage can": (1.48, (0.41, 0.83, 0.50, 3.34)),
    "house plant": (2.02, (1.00, 1.25, 1.33, 0.19)),
    "kettle": (0.28, (0.17, 4.02, 0.17, 0.17)),
    "key chain": (0.95, (1.45, 0.04, 1.80, 0.04)),
    "knife": (0.37, (0.10, 4.26, 0.10, 0.10)),
    "ladle": (0.15, (0.15, 4.09, 0.15, 0.15)),
    "laptop": (1.22, (1.75, 0.03, 1.34, 0.03)),
    "laundry hamper": (0.11, (0.91, 0.25, 0.25, 3.33)),
    "lettuce": (0.63, (0.06, 4.40, 0.06, 0.06)),
    "microwave": (0.17, (0.18, 3.97, 0.18, 0.18)),
    "mug": (0.83, (1.69, 1.57, 0.05, 0.05)),
    "newspaper": (0.47, (0.08, 0.08, 3.87, 0.08)),
    "ottoman": (0.02, None),
    "painting": (6.72, (0.90, 0.87, 0.90, 1.56)),
    "pan": (0.27, (0.12, 4.20, 0.12, 0.12)),
    "paper towel roll": (0.32, (0.10, 2.76, 0.10, 2.10)),
    "pen": (1.23, (1.45, 0.66, 1.25, 0.04)),
    "pencil": (1.8, (1.43, 0.50, 1.42, 0.02)),
    "pepper shaker": (0.26, (0.09, 4.30, 0.09, 0.09)),
    "pillow": (2.04, (1.81, 0.02, 1.26, 0.02)),
    "plate": (0.85, (0.04, 1.63, 2.58, 0.04)),
    "plunger": (0.85, (0.04, 0.04, 0.04, 5.95)),
    "pot": (0.35, (0.11, 4.23, 0.11, 0.11)),
    "potato": (0.47, (0.07, 4.36, 0.07, 0.07)),
    "remote control": (1.85, (1.51, 0.02, 1.72, 0.02)),
    "room decor": (0.03, None),
    "safe": (0.17, (1.55, 0.98, 0.71, 0.17)),
    "salt shaker": (0.31, (0.10, 4.27, 0.10, 0.10)),
    "shelving unit": (0.6, (0.29, 2.95, 0.99, 0.08)),
    "side table": (0.74, (1.52, 0.40, 1.20, 0.28)),
    "sink": (0.94, (0.04, 0.04, 0.04, 5.96)),
    "soap bar": (0.14, (0.20, 0.20, 0.20, 5.13)),
    "soap bottle": (0.62, (0.06, 2.96, 0.06, 1.99)),
    "sofa": (0.86, (0.07, 0.04, 3.95, 0.04)),
    "spatula": (0.34, (0.07, 4.36, 0.07, 0.07)),
    "spoon": (0.37, (0.10, 4.25, 0.10, 0.10)),
    "spray bottle": (1.02, (0.04, 2.27, 0.04, 3.01)),
    "statue": (1.65, (1.21, 1.01, 1.31, 0.03)),
    "stool": (0.42, (0.29, 3.87, 0.16, 0.08)),
    "table top decor": (0.02, None),
    "teddy bear": (0.33, (2.46, 0.11, 0.11, 0.11)),
    "television": (1.63, (0.94, 0.56, 2.14, 0.02)),
    "tennis racket": (0.34, (2.45, 0.11, 0.11, 0.11)),
    "tissue box": (0.57, (1.94, 0.07, 0.84, 0.28)),
    "toaster": (0.26, (0.11, 4.24, 0.11, 0.11)),
    "toilet": (0.94, (0.04, 0.04, 0.04, 5.96)),
    "toilet paper": (0.76, (0.05, 0.05, 0.05, 5.93)),
    "tomato": (0.74, (0.05, 4.45, 0.05, 0.05)),
    "tv stand": (0.74, (0.58, 0.06, 3.14, 0.06)),
    "vacuum cleaner": (0.03, None),
    "vase": (1.44, (1.16, 1.21, 1.21, 0.03)),
    "washing machine": (0.16, (0.21, 0.21, 0.21, 5.08)),
    "watch": (0.96, (1.55, 0.04, 1.62, 0.04)),
    "wine bottle": (0.38, (0.12, 4.17, 0.12, 0.12)),
}
"""The mean number of a type's objects in 100 square metres of floor, and its rooms, by canonical noun.

These are its frequency in each type of room, relative to the mean of the floor, with four objects added by area. They
are counted in the 88 houses of `procthor-generated/houses-train` by `scripts/data/fit_priors.py`, for types with five
objects or more.
"""
UNKNOWN_PER_100_M2 = 0.6
"""The number for other types: the median."""
KNOWN_SHARE = 0.8
"""Share of the trust in these numbers; the rest of it is in 1."""


@cache
def usual_size(noun: str) -> tuple[float, float] | None:
    """Return the median size of a type, and its median ratio of height to the longer side.

    Returns:
        Edge in metres of the cube with an object's volume, and the ratio; `None` for a type with fewer than three
        assets.
    """
    sizes_m = np.array([size_m for _, category, size_m in _core.assets() if canonical(category) == noun])
    if len(sizes_m) < 3:
        return None
    edges_m, ratios = np.cbrt(sizes_m.prod(axis=1)), sizes_m[:, 1] / np.maximum(sizes_m[:, 0], sizes_m[:, 2])
    return float(np.median(edges_m)), float(np.median(ratios))


def per_100_m2(noun: str) -> float:
    """Return the mean number of objects of a type in 100 square metres of floor."""
    return OF_TYPE.get(noun, (UNKNOWN_PER_100_M2, None))[0]


def room_ratios(noun: str) -> dict[str, float]:
    """Return how much likelier a type is in each type of room than elsewhere; empty for an unknown type."""
    _, ratios = OF_TYPE.get(noun, (None, None))
    if ratios is None:
        return {}
    return {room: KNOWN_SHARE * ratio + 1.0 - KNOWN_SHARE for room, ratio in zip(ROOM_ORDER, ratios, strict=True)}


FURNITURE = frozenset(
    {
        *("bathtub", "bed", "clothes dryer", "coffee table", "countertop", "desk", "dining table", "dresser", "fridge"),
        *("safe", "shelving unit", "side table", "sink", "sofa", "toilet", "tv stand", "washing machine"),
    }
)
"""Canonical nouns of ProcTHOR's larger furniture; seats and boxes, which people push about, are none."""


def is_furniture(label: str) -> bool:
    """Return whether a label is of a piece of furniture."""
    return canonical(label) in FURNITURE
