"""Priors of Belief-Weighted Search: how homes change, and which objects are in which rooms."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ChangePrior:
    """Probabilities of a change between two stages."""

    change: float
    """Probability that a room changes."""
    modes: tuple[float, ...]
    """Probability of each way in which it changes, if it does."""
    moved: tuple[float, ...]
    """Share of the room's objects that move, by that way."""
    visited_weight: float = 1.0
    """Weight of a room that the agent visited in the last stage, relative to others."""
    repeated_weight: float = 1.0
    """Factor of a room that seems to have changed before the last stage."""
    same_room: float = 0.5
    """Probability that an object that moved is still in its room (kappa)."""
    knows_rooms: bool = True
    """Whether it knows which objects are frequent in which rooms."""

    @property
    def mean_moved(self) -> float:
        """Probability that an object of a changed room moved."""
        return sum(mode * moved for mode, moved in zip(self.modes, self.moved, strict=True))


BLIND = ChangePrior(change=0.5, modes=(0.5, 0.5), moved=(0.25, 0.75), knows_rooms=False)
"""Knows nothing of the benchmark: the mean of Beta(1, 1), few or most objects move, all rooms alike."""
FITTED = ChangePrior(change=0.55, modes=(0.45, 0.41, 0.14), moved=(0.26, 0.85, 0.87), same_room=0.99)
"""Counts of 60 training tasks by `scripts/data/fit_priors.py`: 168 transitions, 93 changes, 1,118 moved objects.

The tasks are those of the first 60 houses of `procthor-generated/houses-train`, seed 0. All objects that moved stayed
in their rooms."""
ORACLE_THETA = ChangePrior(
    change=0.5,
    modes=(0.5, 0.4, 0.1),
    moved=(0.26, 0.85, 0.87),
    visited_weight=3.0,
    repeated_weight=0.5,
    same_room=0.99,
)
"""Constants by which tasks are generated (paper, Tab. 5), and the shares of objects that move (docs/dataset.md)."""

ROOM_ORDER = ("bedroom", "kitchen", "living room", "bathroom")
"""Order of the numbers of `ROOM_RATIOS`."""
ROOM_RATIOS: dict[str, tuple[float, float, float, float]] = {
    "alarm clock": (2.53, 0.06, 0.06, 0.06),
    "apple": (0.07, 4.37, 0.07, 0.07),
    "arm chair": (1.72, 0.04, 1.36, 0.04),
    "baseball bat": (2.56, 0.05, 0.05, 0.05),
    "basket ball": (2.54, 0.06, 0.06, 0.06),
    "bed": (2.59, 0.03, 0.03, 0.03),
    "book": (1.67, 0.52, 1.04, 0.01),
    "boots": (1.61, 0.44, 0.90, 0.44),
    "bottle": (0.17, 4.02, 0.17, 0.17),
    "bowl": (1.02, 1.18, 1.46, 0.03),
    "box": (1.66, 0.04, 1.46, 0.04),
    "bread": (0.10, 4.28, 0.10, 0.10),
    "butter knife": (0.07, 4.36, 0.07, 0.07),
    "candle": (0.04, 0.04, 2.21, 2.73),
    "cart": (0.16, 0.16, 3.63, 0.16),
    "cd": (2.53, 0.07, 0.07, 0.07),
    "cell phone": (1.43, 0.50, 1.42, 0.02),
    "chair": (1.22, 1.23, 1.11, 0.01),
    "cloth": (0.43, 0.08, 0.08, 4.94),
    "clothes dryer": (0.24, 0.24, 0.24, 4.95),
    "coffee machine": (0.14, 4.11, 0.14, 0.14),
    "coffee table": (1.61, 0.44, 0.90, 0.44),
    "countertop": (0.05, 4.44, 0.05, 0.05),
    "credit card": (1.37, 0.77, 1.27, 0.04),
    "cup": (0.09, 4.30, 0.09, 0.09),
    "desk": (2.39, 0.15, 0.15, 0.15),
    "desk lamp": (1.64, 0.04, 1.48, 0.04),
    "dining table": (0.71, 0.80, 2.28, 0.02),
    "dish sponge": (0.05, 1.80, 0.05, 3.58),
    "dog bed": (1.56, 0.11, 1.52, 0.11),
    "dresser": (2.17, 0.03, 0.42, 0.42),
    "egg": (0.03, 4.51, 0.03, 0.03),
    "faucet": (0.02, 0.66, 0.02, 5.20),
    "floor lamp": (1.66, 0.05, 1.45, 0.05),
    "fork": (0.09, 4.29, 0.09, 0.09),
    "fridge": (0.05, 4.44, 0.05, 0.05),
    "garbage bag": (0.14, 4.13, 0.14, 0.14),
    "garbage can": (0.41, 0.83, 0.50, 3.34),
    "house plant": (1.00, 1.25, 1.33, 0.19),
    "kettle": (0.17, 4.02, 0.17, 0.17),
    "key chain": (1.45, 0.04, 1.80, 0.04),
    "knife": (0.10, 4.26, 0.10, 0.10),
    "ladle": (0.15, 4.09, 0.15, 0.15),
    "laptop": (1.75, 0.03, 1.34, 0.03),
    "laundry hamper": (0.91, 0.25, 0.25, 3.33),
    "lettuce": (0.06, 4.40, 0.06, 0.06),
    "microwave": (0.18, 3.97, 0.18, 0.18),
    "mug": (1.69, 1.57, 0.05, 0.05),
    "newspaper": (0.08, 0.08, 3.87, 0.08),
    "painting": (0.90, 0.87, 0.90, 1.56),
    "pan": (0.12, 4.20, 0.12, 0.12),
    "paper towel roll": (0.10, 2.76, 0.10, 2.10),
    "pen": (1.45, 0.66, 1.25, 0.04),
    "pencil": (1.43, 0.50, 1.42, 0.02),
    "pepper shaker": (0.09, 4.30, 0.09, 0.09),
    "pillow": (1.81, 0.02, 1.26, 0.02),
    "plate": (0.04, 1.63, 2.58, 0.04),
    "plunger": (0.04, 0.04, 0.04, 5.95),
    "pot": (0.11, 4.23, 0.11, 0.11),
    "potato": (0.07, 4.36, 0.07, 0.07),
    "remote control": (1.51, 0.02, 1.72, 0.02),
    "safe": (1.55, 0.98, 0.71, 0.17),
    "salt shaker": (0.10, 4.27, 0.10, 0.10),
    "shelving unit": (0.29, 2.95, 0.99, 0.08),
    "side table": (1.52, 0.40, 1.20, 0.28),
    "sink": (0.04, 0.04, 0.04, 5.96),
    "soap bar": (0.20, 0.20, 0.20, 5.13),
    "soap bottle": (0.06, 2.96, 0.06, 1.99),
    "sofa": (0.07, 0.04, 3.95, 0.04),
    "spatula": (0.07, 4.36, 0.07, 0.07),
    "spoon": (0.10, 4.25, 0.10, 0.10),
    "spray bottle": (0.04, 2.27, 0.04, 3.01),
    "statue": (1.21, 1.01, 1.31, 0.03),
    "stool": (0.29, 3.87, 0.16, 0.08),
    "teddy bear": (2.46, 0.11, 0.11, 0.11),
    "television": (0.94, 0.56, 2.14, 0.02),
    "tennis racket": (2.45, 0.11, 0.11, 0.11),
    "tissue box": (1.94, 0.07, 0.84, 0.28),
    "toaster": (0.11, 4.24, 0.11, 0.11),
    "toilet": (0.04, 0.04, 0.04, 5.96),
    "toilet paper": (0.05, 0.05, 0.05, 5.93),
    "tomato": (0.05, 4.45, 0.05, 0.05),
    "tv stand": (0.58, 0.06, 3.14, 0.06),
    "vase": (1.16, 1.21, 1.21, 0.03),
    "washing machine": (0.21, 0.21, 0.21, 5.08),
    "watch": (1.55, 0.04, 1.62, 0.04),
    "wine bottle": (0.12, 4.17, 0.12, 0.12),
}
"""Frequency of a type in each type of room, relative to the mean of the floor, with four objects added by area.

Counted in the 88 houses of `procthor-generated/houses-train` by `scripts/data/fit_priors.py`; types with five objects
or more.
"""
KNOWN_SHARE = 0.8
"""Share of the trust in these numbers; the rest of it is in 1."""


def room_ratios(noun: str) -> dict[str, float]:
    """Return how much likelier a type is in each type of room than elsewhere; empty for an unknown type."""
    ratios = ROOM_RATIOS.get(noun)
    if ratios is None:
        return {}
    return {room: KNOWN_SHARE * ratio + 1.0 - KNOWN_SHARE for room, ratio in zip(ROOM_ORDER, ratios, strict=True)}
