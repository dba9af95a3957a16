"""Furniture: what hardly moves, and carries other things."""

from evonav.decision.text.language import canonical

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
