"""The words of instructions, and their grammar.

A `basic_instruction` (paper, Sec. A.4) is one sentence, made by `evonav.generation.describe` and readable by rule:

    instruction := "Please navigate to the " NOUN {" " RELATION} "."
    RELATION    := "in the " ROOM                       the room, when the category is not unique in the house
                 | "on the " NOUN                       what it stands on or in
                 | "next to the " NOUN [" and the " NOUN]   at most two nearby objects
                 | "near the " STRUCTURE                a door or a window
                 | "below the " NOUN | "near the " NOUN     something on a wall
    STRUCTURE   := "doorway" | "window"

Relations come in this order, each at most once but "near". `NOUN` is `noun_of` a ProcTHOR object type, `ROOM` is
`noun_of` a room type. An `appearance_instruction` is "Please navigate to the ADJECTIVES NOUN.", a
`unified_instruction` is the basic one with the same adjectives before its first noun; adjectives are the words of
`SIZES` and `COLOURS`, separated by spaces, size first.
"""

import re

SIZES = ("tiny", "small", "large")
"""Words for the largest edge of a target: under 0.12 m, under 0.45 m, over 1.2 m; none in between."""

COLOURS = (
    "black",
    "white",
    "grey",
    "red",
    "orange",
    "yellow",
    "green",
    "blue",
    "purple",
    "pink",
    "brown",
    "beige",
)
"""Words for the colour that a target has in its reference image."""

STRUCTURES = ("doorway", "window")
"""Parts of the house that instructions refer to."""

_IRREGULAR = {"ArmChair": "armchair", "CD": "CD", "CounterTop": "countertop", "TVStand": "TV stand"}


def noun_of(category: str) -> str:
    """Words for a ProcTHOR object or room type: `noun_of("DiningTable")` is `dining table`.

    No two ProcTHOR types share a noun.
    """
    if category in _IRREGULAR:
        return _IRREGULAR[category]
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", " ", category).lower()
