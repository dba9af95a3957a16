"""The words of instructions, and their grammar.

All three instructions of `evonav.generation.instructions.describe` are one sentence each and readable by rule; those
that a language model writes (`PublicStage.writer` says so) are free English.

    basic_instruction      := "Please navigate to the " NOUN {" " RELATION} "."
    appearance_instruction := "Please navigate to the " LOOKS "."
    unified_instruction    := "Please navigate to the " LOOKS {" " RELATION} "."

    LOOKS    := [SIZE " "] [SHAPE " "] [COLOUR [" and " COLOUR] " "] [MATERIAL " "] NOUN
                [" with " DETAIL [" and " DETAIL]]
    DETAIL   := "a " PART | NUMBER " " PARTS | PARTS
    RELATION := ROOM | SUPPORT | NEAR | [","] EXTRA [" and " EXTRA]
    ROOM     := "in the " NOUN | "in one of the " NOUNS         when the category is not unique in the house
    SUPPORT  := "on " THING | "in " THING                       what it stands on, or the basin or cupboard it is in
    NEAR     := "next to " THING [" and " THING]                at most two nearby objects
    EXTRA    := "near " PLACE [" and " THING] | "in a corner"   a door, a window, or a corner of the room
              | "below " THING | "near " THING                  something on a wall
    THING    := "the " NOUN | "a " NOUN | "some " NOUNS
    PLACE    := "the " STRUCTURE | "a " STRUCTURE

Relations come in this order, each at most once; "the" is said of what the room has one of, "some" of several that are
all near. `NOUN` is `noun_of` a ProcTHOR object or room type, `NOUNS` its plural, `SIZE` says how large a thing is for
its kind, and the other words are those of `SHAPES`, `COLOURS` (two if the second colour covers much of it) and
`MATERIALS`. A comma stands before the extras if a support or a neighbour comes before them.
"""

import re

SIZES = ("small", "large")
"""Words for the size of a target among the catalogue's assets of its category; none for the middle."""

SHAPES = ("round", "square", "rectangular", "L-shaped", "U-shaped", "long", "tall", "slim", "wide", "low")
"""Words for a target's form and proportions."""

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
"""Words for the colours that a target shows in its reference image."""

MATERIALS = {
    "cardboard": "cardboard",
    "ceramic": "ceramic",
    "fabric": "fabric",
    "glass": "glass",
    "leather": "leather",
    "metal": "metal",
    "paper": "paper",
    "plastic": "plastic",
    "rubber": "rubber",
    "stone": "stone",
    "wax": "wax",
    "wood": "wooden",
}
"""Adjectives for what a target is made of."""

STRUCTURES = ("doorway", "window", "corner")
"""Parts of the house that instructions refer to."""

NUMBERS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve")
"""Words for counts of parts."""

_IRREGULAR = {"ArmChair": "armchair", "CD": "CD", "CounterTop": "countertop", "TVStand": "TV stand"}
_PLURALS = {"decor": "decor", "foil": "foil", "knife": "knives", "paper": "paper", "shelf": "shelves"}
_UNCOUNTED = {"aluminum foil", "blinds", "boots", "bread", "lettuce", "room decor", "table top decor", "toilet paper"}


def noun_of(category: str) -> str:
    """Words for a ProcTHOR object or room type: `noun_of("DiningTable")` is `dining table`.

    No two ProcTHOR types share a noun.
    """
    if category in _IRREGULAR:
        return _IRREGULAR[category]
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", " ", category).lower()


def plural_of(noun: str) -> str:
    """Several of a noun: `plural_of("wine bottle")` is `wine bottles`."""
    head, _, last = noun.rpartition(" ")
    if noun in _UNCOUNTED:
        return noun
    if last in _PLURALS:
        last = _PLURALS[last]
    elif re.search(r"(s|x|z|ch|sh|[^aeiou]o)$", last):
        last += "es"
    elif re.search(r"[^aeiou]y$", last):
        last = last[:-1] + "ies"
    else:
        last += "s"
    return f"{head} {last}" if head else last


def with_article(noun: str) -> str:
    """One of several: `an armchair`, `a mug`, `some bread`."""
    if noun in _UNCOUNTED:
        return f"some {noun}"
    return f"an {noun}" if noun[0] in "aeiou" else f"a {noun}"


def listed(words: list[str]) -> str:
    """`a`, `a and b`, `a, b and c`."""
    return " and ".join([", ".join(words[:-1]), words[-1]]) if len(words) > 1 else "".join(words)
