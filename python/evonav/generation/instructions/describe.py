"""Instructions for a target: deterministic, in the grammar of `evonav.tasks.language`.

The paper has `gpt-4o` write the appearance and unified instructions from the reference image (Sec. A.4); these come
from what the renderer and the asset catalogue know, so that tasks are reproduced without a network. `evonav tasks
write` has a model write them as the paper does.
"""

from typing import Annotated, Any, Literal

from pydantic import Field

from evonav.generation.instructions.appearance import Appearance, details_of, looks_of
from evonav.tasks.language import listed, noun_of, plural_of, with_article
from evonav.tasks.records import Id, Record

WRITER = "evonav-describer 1"
"""Who wrote such instructions; another number for other words."""


class Anchor(Record):
    """A thing that an instruction refers to (the core's `Anchor`)."""

    category: Id
    determiner: Literal["the", "a", "some"]

    @property
    def words(self) -> str:
        """With its article."""
        noun = noun_of(self.category)
        if self.determiner == "some":
            return f"some {plural_of(noun)}"
        return f"the {noun}" if self.determiner == "the" else with_article(noun)


class Relations(Record):
    """What surrounds a target, in categories (the core's `Relations`)."""

    room_type: str
    is_category_unique: bool
    is_room_type_unique: bool = True
    support: Anchor | None = None
    is_in_support: bool = False
    neighbours: Annotated[tuple[Anchor, ...], Field(max_length=2)] = ()
    structure: Anchor | None = None
    wall_object: Anchor | None = None
    is_below_wall_object: bool = False
    num_fitting: int = 1
    """Objects of the house that all of this fits, read literally; the target is one."""


def basic_instruction(category: str, relations: Relations) -> str:
    """Category and surroundings.

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


def appearance_instruction(category: str, appearance: Appearance) -> str:
    """What it looks like, and nothing of where it is."""
    return _sentence(_described(category, appearance))


def unified_instruction(category: str, relations: Relations, appearance: Appearance) -> str:
    """What it looks like, and where it is."""
    return _sentence(_described(category, appearance), _place(relations))


def _sentence(*phrases: str) -> str:
    return " ".join(["Please navigate to the", *filter(None, phrases)]).replace(" ,", ",") + "."


def _described(category: str, appearance: Appearance) -> str:
    words = " ".join([*looks_of(category, appearance), noun_of(category)])
    details = details_of(category, appearance)
    return f"{words} with {listed(details)}" if details else words


def _place(relations: Relations) -> str:
    """Relations in the grammar's order; empty if there are none."""
    words: list[str] = []
    if not relations.is_category_unique and relations.room_type:
        room = noun_of(relations.room_type)
        words.append(f"in the {room}" if relations.is_room_type_unique else f"in one of the {plural_of(room)}")
    if relations.support is not None:
        words.append(f"{'in' if relations.is_in_support else 'on'} {relations.support.words}")
    if relations.neighbours:
        words.append("next to " + listed([anchor.words for anchor in relations.neighbours]))
    # By preposition, so that "near the window and a painting" says it once.
    extras: dict[str, list[str]] = {}
    if relations.structure is not None:
        is_corner = relations.structure.category == "corner"
        extras.setdefault("in" if is_corner else "near", []).append(relations.structure.words)
    if relations.wall_object is not None:
        preposition = "below" if relations.is_below_wall_object else "near"
        extras.setdefault(preposition, []).append(relations.wall_object.words)
    if extras and (relations.support is not None or relations.neighbours):
        words.append(",")
    said = [f"{preposition} {listed(things)}" for preposition, things in extras.items()]
    return " ".join([*words, listed(said)]).strip()


def parse_relations(record: Any) -> Relations:  # noqa: ANN401
    """Relations from the core's record."""
    return Relations.model_validate({**record, "neighbours": tuple(record["neighbours"])})
