"""Write the instructions of a target by rule, in the grammar of `evonav.tasks.language`.

In the paper `gpt-4o` writes the appearance and unified instructions from the reference image (Sec. A.4). These
instructions are derived from the renderer's shape of the target, its reference image and ProcTHOR's databases, so that
tasks can be reproduced without a network. `evonav tasks write` has a model write them as in the paper.
"""

from collections import Counter, defaultdict
from collections.abc import Iterable
from functools import cache, lru_cache
from typing import NamedTuple

import numpy as np

from evonav import _core
from evonav.generation.result import Anchor, Appearance, Relations, Tint
from evonav.points import Point3
from evonav.tasks.colours import colour_word
from evonav.tasks.language import MATERIALS, NUMBERS, listed, noun_of, plural_of, with_article

WRITER = "evonav-describer 1"
"""Writer of these instructions; the number changes with the wording."""

SECOND_COLOUR_SHARE = 0.25
"""Smallest share of the target's visible pixels at which a second colour is named."""
SMALL_RATIO, LARGE_RATIO = 0.8, 1.25
"""Sizes relative to the category's median below and above which an object is called small or large."""
SQUARE_RATIO, LONG_RATIO = 0.92, 0.45
"""Ratios of a top's shorter to its longer side: it is square above the first, long below the second."""

_TOPS = {"CoffeeTable", "DiningTable", "Footstool", "Ottoman", "SideTable", "Stool"}
"""Furniture that people distinguish by the form of its top."""
_UPRIGHT = {
    "Bottle",
    "Cabinet",
    "Candle",
    "Dresser",
    "FloorLamp",
    "Fridge",
    "GarbageCan",
    "HousePlant",
    "LaundryHamper",
    "ShelvingUnit",
    "Statue",
    "TVStand",
    "Vase",
}
"""Objects that people distinguish by their height or width."""
_BROAD = {"Cabinet", "Dresser", "ShelvingUnit", "TVStand"}
"""Upright objects that may be called wide."""
_SOFT = {"ArmChair", "Bed", "DogBed", "Footstool", "Ottoman", "Sofa"}
"""Upholstered furniture, whose frame is hardly visible."""
_IMPLIED_MATERIALS: dict[str, set[str]] = {
    "fabric": {"Bed", "Cloth", "HandTowel", "Pillow", "ShowerCurtain", "Towel"},
    "paper": {"Book", "Newspaper", "PaperTowelRoll", "TissueBox", "ToiletPaper"},
    "rubber": {"BasketBall"},
    "wax": {"Candle"},
    # This is the pot's material, not the plant's.
    "ceramic": {"HousePlant"},
    "glass": {"Window"},
}
"""Categories whose names already imply a material, by material."""
_UNCOUNTED_PARTS = {"armrest", "pillow"}
"""Parts that come in pairs and are not counted."""


def basic_instruction(category: str, relations: Relations) -> str:
    """Write the basic instruction: category and surroundings.

    >>> kitchen = Relations(
    ...     room_type="Kitchen",
    ...     is_category_unique=False,
    ...     support=Anchor(category="CounterTop", determiner="the"),
    ...     neighbours=(Anchor(category="Sink", determiner="the"),),
    ... )
    >>> basic_instruction("Mug", kitchen)
    'Please navigate to the mug in the kitchen on the countertop next to the sink.'
    """
    return _sentence(noun_of(category), _place(relations))


def appearance_instruction(category: str, size_m: Point3, appearance: Appearance) -> str:
    """Write the appearance instruction: what the target looks like, without where it is."""
    return _sentence(_described(category, size_m, appearance))


def unified_instruction(category: str, size_m: Point3, relations: Relations, appearance: Appearance) -> str:
    """Write the unified instruction: what the target looks like and where it is."""
    return _sentence(_described(category, size_m, appearance), _place(relations))


def _sentence(*phrases: str) -> str:
    return " ".join(["Please navigate to the", *filter(None, phrases)]).replace(" ,", ",") + "."


def _described(category: str, size_m: Point3, appearance: Appearance) -> str:
    noun_phrase = " ".join([*adjectives_of(category, size_m, appearance), noun_of(category)])
    details = details_of(category, appearance)
    return f"{noun_phrase} with {listed(details)}" if details else noun_phrase


def _place(relations: Relations) -> str:
    """Return the relations in the grammar's order; empty if there are none."""
    phrases: list[str] = []
    if not relations.is_category_unique and relations.room_type:
        room = noun_of(relations.room_type)
        phrases.append(f"in the {room}" if relations.is_room_type_unique else f"in one of the {plural_of(room)}")
    if relations.support is not None:
        phrases.append(f"{'in' if relations.is_in_support else 'on'} {_noun_phrase(relations.support)}")
    if relations.neighbours:
        phrases.append("next to " + listed([_noun_phrase(anchor) for anchor in relations.neighbours]))
    # Grouped by preposition, as in "near the window and a painting".
    extras: dict[str, list[str]] = {}
    if relations.structure is not None:
        is_corner = relations.structure.category == "corner"
        extras.setdefault("in" if is_corner else "near", []).append(_noun_phrase(relations.structure))
    if relations.wall_object is not None:
        preposition = "below" if relations.is_below_wall_object else "near"
        extras.setdefault(preposition, []).append(_noun_phrase(relations.wall_object))
    if extras and (relations.support is not None or relations.neighbours):
        phrases.append(",")
    extra_phrases = [f"{preposition} {listed(things)}" for preposition, things in extras.items()]
    return " ".join([*phrases, listed(extra_phrases)]).strip()


def _noun_phrase(anchor: Anchor) -> str:
    """Return an anchor's noun with its article."""
    noun = noun_of(anchor.category)
    if anchor.determiner == "some":
        return f"some {plural_of(noun)}"
    return f"the {noun}" if anchor.determiner == "the" else with_article(noun)


def adjectives_of(category: str, size_m: Point3, appearance: Appearance) -> list[str]:
    """Return the adjectives before the noun, in the grammar's order."""
    adjectives = (
        size_word(category, size_m),
        shape_word(category, size_m, appearance.form),
        " and ".join(colour_words(appearance.tints)),
        material_word(category, appearance.made_of),
    )
    return [adjective for adjective in adjectives if adjective]


def size_word(category: str, size_m: Point3) -> str | None:
    """Return `small` or `large`, relative to the catalogue's assets of the category; `None` in between."""
    usual = _usual_of(category)
    if usual is None or usual.num_assets < 3:
        return None
    ratio = _edge_m(size_m) / usual.edge_m
    return "small" if ratio < SMALL_RATIO else "large" if ratio > LARGE_RATIO else None


def shape_word(category: str, size_m: Point3, form: str | None) -> str | None:
    """Return an object's form, or a word for its proportions where people use one."""
    if form is not None:
        return form
    width_m, height_m, depth_m = size_m
    short_m, long_m = sorted((width_m, depth_m))
    if category in _TOPS:
        ratio = short_m / long_m
        return "square" if ratio > SQUARE_RATIO else "long" if ratio < LONG_RATIO else "rectangular"
    usual = _usual_of(category)
    if category in _UPRIGHT and usual is not None:
        # Both the object itself and its ratio to its category must be extreme.
        ratio = height_m / long_m
        if ratio > 1.3 and ratio > 1.3 * usual.ratio:
            return "tall"
        if category in _BROAD and ratio < 0.9 and ratio < usual.ratio / 1.3:
            return "wide"
    return None


def colour_words(tints: Iterable[Tint]) -> list[str]:
    """Return the colour with the largest share, and a second one if its share is large enough."""
    shares: Counter[str] = Counter()
    for tint in tints:
        shares[colour_word(tint.colour)] += tint.share  # type: ignore[assignment]
    ranked = sorted(shares.items(), key=lambda pair: (-pair[1], pair[0]))
    return [word for index, (word, share) in enumerate(ranked[:2]) if index == 0 or share >= SECOND_COLOUR_SHARE]


def material_word(category: str, made_of: Iterable[str]) -> str | None:
    """Return the adjective of the main material, unless the category implies it."""
    materials = list(made_of)
    covers = [material for material in materials if material in ("fabric", "leather")]
    first = next(iter(covers if category in _SOFT else materials), None)
    if first not in MATERIALS or category in _IMPLIED_MATERIALS.get(first, ()):
        return None
    return "cardboard" if (category, first) == ("Box", "paper") else MATERIALS[first]


def details_of(category: str, appearance: Appearance) -> list[str]:
    """Return up to two parts that distinguish an object, with their number."""
    phrases: list[str] = []
    for detail in appearance.details[:2]:
        if detail.count == 1:
            phrases.append(with_article(detail.noun))
        elif detail.noun in _UNCOUNTED_PARTS or detail.count >= len(NUMBERS):
            phrases.append(plural_of(detail.noun))
        else:
            phrases.append(f"{NUMBERS[detail.count]} {plural_of(detail.noun)}")
    if category == "HousePlant" and "ceramic" in appearance.made_of:
        return ["a ceramic pot"]
    return phrases


def _edge_m(size_m: Point3) -> float:
    """Return the edge of the cube with the same volume: a size that does not depend on the form."""
    return float(np.cbrt(np.prod(size_m)))


class _Usual(NamedTuple):
    """The usual size of a category's assets: medians over the catalogue."""

    num_assets: int
    edge_m: float
    ratio: float
    """Height over the longer side."""


@cache
def _usual_of(category: str) -> _Usual | None:
    """Return the usual size of a category; `None` if the catalogue has no asset of it."""
    sizes_m = _sizes_m().get(category)
    if sizes_m is None:
        return None
    edges_m = [_edge_m(size_m) for size_m in sizes_m]
    ratios = [height_m / max(width_m, depth_m) for width_m, height_m, depth_m in sizes_m]
    return _Usual(len(sizes_m), float(np.median(edges_m)), float(np.median(ratios)))


@lru_cache(maxsize=1)
def _sizes_m() -> dict[str, list[Point3]]:
    """Return the sizes of the catalogue's assets by category."""
    sizes_m: dict[str, list[Point3]] = defaultdict(list)
    for _, category, size_m in _core.assets():
        sizes_m[category].append(size_m)
    return dict(sizes_m)
