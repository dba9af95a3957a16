"""Write the instructions of a target by rule, in the grammar of `evonav.tasks.language`.

In the paper `gpt-4o` writes the appearance and unified instructions from the reference image (Sec. A.4). These
instructions are derived from the renderer and the asset catalogue, so that tasks can be reproduced without a network.
`evonav tasks write` has a model write them as in the paper.
"""

from evonav.generation.instructions.appearance import adjectives_of, details_of
from evonav.generation.result import Anchor, Appearance, Relations
from evonav.records import Point3
from evonav.tasks.language import listed, noun_of, plural_of, with_article

WRITER = "evonav-describer 1"
"""Writer of these instructions; the number changes with the wording."""


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
