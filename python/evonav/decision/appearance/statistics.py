"""Statistics of homes, the common knowledge of the rules, counted in the 151 bundled homes.

Of the tasks only the bundled ones are of these homes.
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

PER_100_M2 = {
    "alarm clock": 0.62,
    "apple": 0.53,
    "arm chair": 0.74,
    "baseball bat": 0.81,
    "basket ball": 0.7,
    "bed": 1.32,
    "book": 3.22,
    "boots": 0.04,
    "bottle": 0.23,
    "bowl": 1.58,
    "box": 0.99,
    "bread": 0.39,
    "butter knife": 0.46,
    "candle": 0.99,
    "cart": 0.18,
    "cd": 0.56,
    "cell phone": 1.83,
    "chair": 3.98,
    "cloth": 0.54,
    "clothes dryer": 0.11,
    "coffee machine": 0.23,
    "coffee table": 0.05,
    "countertop": 0.74,
    "credit card": 1.08,
    "cup": 0.34,
    "desk": 0.28,
    "desk lamp": 1.02,
    "desktop": 0.01,
    "dining table": 1.92,
    "dish sponge": 0.68,
    "dog bed": 0.3,
    "dresser": 1.44,
    "dumbbell": 0.05,
    "egg": 1.17,
    "faucet": 1.93,
    "floor lamp": 0.69,
    "fork": 0.31,
    "fridge": 0.78,
    "garbage bag": 0.24,
    "garbage can": 1.48,
    "house plant": 2.02,
    "kettle": 0.28,
    "key chain": 0.95,
    "knife": 0.37,
    "ladle": 0.15,
    "laptop": 1.22,
    "laundry hamper": 0.11,
    "lettuce": 0.63,
    "microwave": 0.17,
    "mug": 0.83,
    "newspaper": 0.47,
    "ottoman": 0.02,
    "painting": 6.72,
    "pan": 0.27,
    "paper towel roll": 0.32,
    "pen": 1.23,
    "pencil": 1.8,
    "pepper shaker": 0.26,
    "pillow": 2.04,
    "plate": 0.85,
    "plunger": 0.85,
    "pot": 0.35,
    "potato": 0.47,
    "remote control": 1.85,
    "room decor": 0.03,
    "safe": 0.17,
    "salt shaker": 0.31,
    "shelving unit": 0.6,
    "side table": 0.74,
    "sink": 0.94,
    "soap bar": 0.14,
    "soap bottle": 0.62,
    "sofa": 0.86,
    "spatula": 0.34,
    "spoon": 0.37,
    "spray bottle": 1.02,
    "statue": 1.65,
    "stool": 0.42,
    "table top decor": 0.02,
    "teddy bear": 0.33,
    "television": 1.63,
    "tennis racket": 0.34,
    "tissue box": 0.57,
    "toaster": 0.26,
    "toilet": 0.94,
    "toilet paper": 0.76,
    "tomato": 0.74,
    "tv stand": 0.74,
    "vacuum cleaner": 0.03,
    "vase": 1.44,
    "washing machine": 0.16,
    "watch": 0.96,
    "wine bottle": 0.38,
}
"""Mean number of objects of a type in 100 square metres of floor, by canonical noun."""

UNKNOWN_PER_100_M2 = 0.6
"""The number for other types: the median."""


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
