"""Rule-based instructions, word by word."""

import pytest

from evonav._core import assets
from evonav.generation.instructions.describe import (
    appearance_instruction,
    basic_instruction,
    size_word,
    unified_instruction,
)
from evonav.generation.result import Anchor, Appearance, Detail, Relations, Tint
from evonav.tasks.colours import colour_word

SIZES_M = {category: tuple(size_m) for _, category, size_m in assets()}


def the(category: str, determiner: str = "the") -> Anchor:
    return Anchor.model_validate({"category": category, "determiner": determiner})


def where(**fields: object) -> Relations:
    return Relations.model_validate({"room_type": "Kitchen", "is_category_unique": True, **fields})


@pytest.mark.parametrize(
    ("relations", "sentence"),
    [
        (where(), "the mug."),
        (where(is_category_unique=False), "the mug in the kitchen."),
        (where(is_category_unique=False, is_room_type_unique=False), "the mug in one of the kitchens."),
        (where(support=the("CounterTop", "a")), "the mug on a countertop."),
        (where(support=the("Sink"), is_in_support=True), "the mug in the sink."),
        (where(neighbours=(the("Apple", "a"), the("Knife", "some"))), "the mug next to an apple and some knives."),
        (where(structure=the("window", "a")), "the mug near a window."),
        (where(structure=the("corner", "a")), "the mug in a corner."),
        (where(wall_object=the("Painting"), is_below_wall_object=True), "the mug below the painting."),
        (where(structure=the("window"), wall_object=the("Painting", "a")), "the mug near the window and a painting."),
        (
            where(
                support=the("Desk"), structure=the("doorway"), wall_object=the("Television"), is_below_wall_object=True
            ),
            "the mug on the desk, near the doorway and below the television.",
        ),
    ],
)
def test_places(relations: Relations, sentence: str) -> None:
    assert basic_instruction("Mug", relations) == f"Please navigate to {sentence}"


def described(
    category: str,
    colours: tuple[tuple[int, int, int, float], ...] = (),
    size_m: tuple[float, float, float] | None = None,
    **fields: object,
) -> str:
    size_m = size_m or SIZES_M[category]
    tints = tuple(Tint(colour=(red, green, blue), share=share) for red, green, blue, share in colours)
    appearance = Appearance.model_validate({"tints": tints, **fields})
    sentence = appearance_instruction(category, size_m, appearance)
    relations = where(support=the("Desk"))
    place = " on the desk."
    assert unified_instruction(category, size_m, relations, appearance) == sentence.removesuffix(".") + place
    return sentence.removeprefix("Please navigate to the ")


def test_appearance_instructions() -> None:
    white, brown, steel = (240, 240, 240), (120, 78, 48), (60, 60, 64)
    drawers = (Detail(noun="drawer", count=6), Detail(noun="door", count=2), Detail(noun="leg", count=4))
    typical = tuple(sorted(size[i] for _, name, size in assets() if name == "Mug")[2] for i in range(3))
    mug = described("Mug", ((*white, 0.7), (*brown, 0.3)), made_of=("ceramic",), size_m=typical)
    assert mug == "white and brown ceramic mug."
    assert described("Mug", ((*white, 0.8), (*brown, 0.2)), size_m=typical) == "white mug."
    # Two materials of one colour are one colour.
    assert (
        described("Mug", ((*brown, 0.3), (*white, 0.4), (130, 80, 50, 0.3)), size_m=typical) == "brown and white mug."
    )
    assert described("Mug", made_of=("food",), size_m=typical) == "mug."
    sofa = {"size_m": (2.0, 0.9, 0.9), "details": (Detail(noun="armrest", count=2), Detail(noun="open lid", count=1))}
    assert described("Sofa", made_of=("wood", "fabric"), **sofa) == "fabric sofa with armrests and an open lid."
    assert described("Sofa", made_of=("metal",), **sofa) == "sofa with armrests and an open lid."
    assert "with six drawers and two doors." in described("Dresser", ((*steel, 1.0),), details=drawers)
    assert described("HousePlant", made_of=("ceramic", "organic")).endswith("house plant with a ceramic pot.")
    assert "cardboard box" in described("Box", made_of=("paper",))
    assert "round" in described("DiningTable", form="round")
    assert "square" in described("DiningTable", size_m=(1.0, 0.7, 0.95))
    assert "rectangular" in described("DiningTable", size_m=(1.6, 0.7, 0.9))
    assert "long" in described("DiningTable", size_m=(2.4, 0.7, 0.9))
    assert "wide" in described("Dresser", size_m=(2.0, 0.5, 0.5))
    assert "tall" in described("Dresser", size_m=(0.6, 2.0, 0.5))


def test_sizes_are_relative_to_the_category() -> None:
    """A small sofa is larger than a large mug."""
    assert size_word("Mug", (0.3, 0.3, 0.3)) == "large"
    assert size_word("Sofa", (0.8, 0.5, 0.5)) == "small"
    assert size_word("NoSuchThing", (1.0, 1.0, 1.0)) is None
    words = [size_word(category, size_m) for _, category, size_m in assets()]
    assert words.count(None) > 0.6 * len(words)
    assert 0.05 * len(words) < words.count("small") < 0.25 * len(words)
    assert 0.05 * len(words) < words.count("large") < 0.25 * len(words)


@pytest.mark.parametrize(
    ("colour", "word"),
    [
        ((10, 10, 12), "black"),
        ((45, 45, 48), "black"),
        ((128, 128, 130), "grey"),
        ((240, 240, 238), "white"),
        ((200, 30, 30), "red"),
        ((190, 120, 105), "brown"),
        ((120, 78, 48), "brown"),
        ((240, 140, 30), "orange"),
        ((235, 220, 60), "yellow"),
        ((70, 120, 60), "green"),
        ((50, 80, 160), "blue"),
        ((120, 60, 170), "purple"),
        ((240, 170, 180), "pink"),
        ((222, 205, 180), "beige"),
    ],
)
def test_colours_have_the_names_that_people_give_them(colour: tuple[int, int, int], word: str) -> None:
    assert colour_word(colour) == word
