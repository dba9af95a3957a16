"""Instructions for a target: deterministic, in the grammar of `evonav.tasks.language`.

The paper has `gpt-4o` write the appearance and unified instructions from the reference image (Sec. A.4); these come
from size and mean colour instead, so that tasks are reproduced without a network. Other texts are as valid.
"""

import colorsys
from typing import Any

from pydantic import Field

from evonav.tasks.language import noun_of
from evonav.tasks.records import Id, Record

TINY_M, SMALL_M, LARGE_M = 0.12, 0.45, 1.2
"""Largest edge of a target: below tiny, below small, above large."""


class Relations(Record):
    """What surrounds a target, in categories (the core's `Relations`)."""

    room_type: str
    is_category_unique: bool
    support: Id | None
    neighbours: tuple[Id, ...] = Field(max_length=2)
    structure: Id | None
    wall_object: Id | None
    is_below_wall_object: bool


def basic_instruction(category: str, relations: Relations, adjectives: tuple[str, ...] = ()) -> str:
    """Category and surroundings; with adjectives, the unified instruction.

    >>> kitchen = Relations(room_type="Kitchen", is_category_unique=False, support="CounterTop", neighbours=("Sink",),
    ...     structure=None, wall_object=None, is_below_wall_object=False)
    >>> basic_instruction("Mug", kitchen)
    'Please navigate to the mug in the kitchen on the countertop next to the sink.'
    """
    words = ["Please navigate to the", *adjectives, noun_of(category)]
    if not relations.is_category_unique and relations.room_type:
        words.append(f"in the {noun_of(relations.room_type)}")
    if relations.support is not None:
        words.append(f"on the {noun_of(relations.support)}")
    if relations.neighbours:
        words.append("next to the " + " and the ".join(noun_of(other) for other in relations.neighbours))
    if relations.structure is not None:
        words.append(f"near the {relations.structure}")
    if relations.wall_object is not None:
        relation = "below" if relations.is_below_wall_object else "near"
        words.append(f"{relation} the {noun_of(relations.wall_object)}")
    return " ".join(words) + "."


def appearance_instruction(category: str, adjectives: tuple[str, ...]) -> str:
    """What it looks like, and nothing of where it is."""
    return " ".join(["Please navigate to the", *adjectives, noun_of(category)]) + "."


def adjectives_of(size_m: tuple[float, float, float], colour: tuple[int, int, int]) -> tuple[str, ...]:
    """Size and colour words.

    Args:
        size_m: Edges of the target's box.
        colour: Its mean colour in the reference image, sRGB.
    """
    edge_m = max(size_m)
    size = "tiny" if edge_m < TINY_M else "small" if edge_m < SMALL_M else "large" if edge_m > LARGE_M else None
    return (colour_word(colour),) if size is None else (size, colour_word(colour))


def colour_word(colour: tuple[int, int, int]) -> str:
    """The nearest of `evonav.tasks.language.COLOURS`, by hue where there is one."""
    hue, lightness, saturation = colorsys.rgb_to_hls(*(channel / 255.0 for channel in colour))
    hue_deg = 360.0 * hue
    chroma = saturation * (1.0 - abs(2.0 * lightness - 1.0))
    if lightness < 0.12:
        return "black"
    if chroma < 0.09:
        return "black" if lightness < 0.2 else "grey" if lightness < 0.72 else "white"
    if hue_deg < 16.0 or hue_deg >= 345.0:
        return "pink" if lightness > 0.65 else "brown" if chroma < 0.3 and lightness < 0.4 else "red"
    if hue_deg < 46.0:
        if lightness > 0.6 and chroma < 0.45:
            return "beige"
        return "orange" if chroma > 0.6 and lightness > 0.4 else "brown"
    if hue_deg < 68.0:
        return "yellow" if chroma > 0.3 else "beige" if lightness > 0.6 else "green"
    if hue_deg < 170.0:
        return "green"
    if hue_deg < 255.0:
        return "blue"
    return "purple" if hue_deg < 305.0 else "pink"


def parse_relations(record: Any) -> Relations:  # noqa: ANN401
    """Relations from the core's record."""
    return Relations.model_validate({**record, "neighbours": tuple(record["neighbours"])})
