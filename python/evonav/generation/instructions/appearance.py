"""Words for what a target looks like: size for its kind, form, colours, material, parts.

Everything said is in the renderer's shape of the target, in its reference image, or in ProcTHOR's databases.
"""

import colorsys
from collections import Counter, defaultdict
from collections.abc import Iterable
from functools import lru_cache
from typing import Any

import numpy as np

from evonav import _core
from evonav.tasks.language import MATERIALS, NUMBERS, plural_of, with_article
from evonav.tasks.records import Record

SECOND_COLOUR_SHARE = 0.25
"""Least share of the target's visible pixels of a second colour that is named."""
SMALL_RATIO, LARGE_RATIO = 0.8, 1.25
"""Size relative to the category's median below and above which a thing is small or large for its kind."""
SQUARE_RATIO, LONG_RATIO = 0.92, 0.45
"""Shorter over longer side of a top: square above, long below."""

_TOPS = {"CoffeeTable", "DiningTable", "Footstool", "Ottoman", "SideTable", "Stool"}
"""Furniture that people tell apart by the form of its top."""
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
"""Things that people tell apart by how tall or wide they are."""
_BROAD = {"Cabinet", "Dresser", "ShelvingUnit", "TVStand"}
"""Of these, what is called wide."""
_SOFT = {"ArmChair", "Bed", "DogBed", "Footstool", "Ottoman", "Sofa"}
"""Upholstered things, whose frames hardly show."""
_UNSAID: dict[str, set[str]] = {
    "fabric": {"Bed", "Cloth", "HandTowel", "Pillow", "ShowerCurtain", "Towel"},
    "paper": {"Book", "Newspaper", "PaperTowelRoll", "TissueBox", "ToiletPaper"},
    "rubber": {"BasketBall"},
    "wax": {"Candle"},
    # The pot's, not the plant's.
    "ceramic": {"HousePlant"},
    "glass": {"Window"},
}
"""Materials that go without saying, by category."""
_UNCOUNTED_PARTS = {"armrest", "pillow"}
"""Parts that come in pairs: nobody counts them."""


class Tint(Record):
    """A material's colour in the reference image."""

    colour: tuple[int, int, int]
    share: float


class Detail(Record):
    """A part of a shape."""

    noun: str
    count: int


class Appearance(Record):
    """What the core knows of a target's looks (its `Appearance`), and its size."""

    size_m: tuple[float, float, float]
    tints: tuple[Tint, ...] = ()
    form: str | None = None
    details: tuple[Detail, ...] = ()
    made_of: tuple[str, ...] = ()


def parse_appearance(record: Any, size_m: Any) -> Appearance:  # noqa: ANN401
    """Appearance from the core's records."""
    return Appearance(
        size_m=tuple(size_m),
        tints=tuple(Tint(colour=tuple(tint["colour"]), share=tint["share"]) for tint in record["tints"]),
        form=record["form"],
        details=tuple(Detail(**detail) for detail in record["details"]),
        made_of=tuple(record["made_of"]),
    )


def looks_of(category: str, appearance: Appearance) -> list[str]:
    """Adjectives before the noun, in the grammar's order."""
    words = [size_word(category, appearance.size_m), shape_word(category, appearance)]
    words.append(" and ".join(colour_words(appearance.tints)))
    words.append(material_word(category, appearance.made_of))
    return [word for word in words if word]


def size_word(category: str, size_m: tuple[float, float, float]) -> str | None:
    """Small or large for its kind: among the catalogue's assets of its category."""
    edges_m = _edges_m().get(category, [])
    if len(edges_m) < 3:
        return None
    ratio = _edge_m(size_m) / float(np.median(edges_m))
    return "small" if ratio < SMALL_RATIO else "large" if ratio > LARGE_RATIO else None


def shape_word(category: str, appearance: Appearance) -> str | None:
    """Its form, or its proportions where people go by them."""
    if appearance.form is not None:
        return appearance.form
    width_m, height_m, depth_m = appearance.size_m
    short_m, long_m = sorted((width_m, depth_m))
    if category in _TOPS:
        ratio = short_m / long_m
        return "square" if ratio > SQUARE_RATIO else "long" if ratio < LONG_RATIO else "rectangular"
    if category in _UPRIGHT and (heights := _height_ratios().get(category)):
        # Said only of what is so both by itself and among its kind.
        ratio, usual = height_m / long_m, float(np.median(heights))
        if ratio > 1.3 and ratio > 1.3 * usual:
            return "tall"
        if category in _BROAD and ratio < 0.9 and ratio < usual / 1.3:
            return "wide"
    return None


def colour_words(tints: Iterable[Tint]) -> list[str]:
    """The colour that shows most, and a second one if it shows much."""
    shares: Counter[str] = Counter()
    for tint in tints:
        shares[colour_word(tint.colour)] += tint.share  # type: ignore[assignment]
    ranked = sorted(shares.items(), key=lambda pair: (-pair[1], pair[0]))
    return [word for index, (word, share) in enumerate(ranked[:2]) if index == 0 or share >= SECOND_COLOUR_SHARE]


def material_word(category: str, made_of: Iterable[str]) -> str | None:
    """What it is mainly made of, unless that goes without saying."""
    materials = list(made_of)
    covers = [material for material in materials if material in ("fabric", "leather")]
    first = next(iter(covers if category in _SOFT else materials), None)
    if first not in MATERIALS or category in _UNSAID.get(first, ()):
        return None
    return "cardboard" if (category, first) == ("Box", "paper") else MATERIALS[first]


def details_of(category: str, appearance: Appearance) -> list[str]:
    """Up to two parts by which it can be told, with their number."""
    words: list[str] = []
    for detail in appearance.details[:2]:
        if detail.count == 1:
            words.append(with_article(detail.noun))
        elif detail.noun in _UNCOUNTED_PARTS or detail.count >= len(NUMBERS):
            words.append(plural_of(detail.noun))
        else:
            words.append(f"{NUMBERS[detail.count]} {plural_of(detail.noun)}")
    if category == "HousePlant" and "ceramic" in appearance.made_of:
        return ["a ceramic pot"]
    return words


def colour_word(colour: tuple[int, int, int]) -> str:
    """The nearest of `evonav.tasks.language.COLOURS`, by hue where there is one."""
    hue, lightness, saturation = colorsys.rgb_to_hls(*(channel / 255.0 for channel in colour))
    hue_deg = 360.0 * hue
    chroma = saturation * (1.0 - abs(2.0 * lightness - 1.0))
    if lightness < 0.12:
        return "black"
    if chroma < 0.09:
        return "black" if lightness < 0.2 else "grey" if lightness < 0.78 else "white"
    if hue_deg < 16.0 or hue_deg >= 345.0:
        is_dull = chroma < 0.36
        return "pink" if lightness > (0.6 if is_dull else 0.7) else "brown" if is_dull else "red"
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


def _edge_m(size_m: tuple[float, float, float]) -> float:
    """Edge of the cube of the same volume: how large a thing looks, whatever its form."""
    return float(np.cbrt(np.prod(size_m)))


@lru_cache(maxsize=1)
def _edges_m() -> dict[str, list[float]]:
    edges_m: dict[str, list[float]] = defaultdict(list)
    for _, category, size_m in _core.assets():
        edges_m[category].append(_edge_m(size_m))
    return dict(edges_m)


@lru_cache(maxsize=1)
def _height_ratios() -> dict[str, list[float]]:
    """Height over the longer side of each asset, by category."""
    ratios: dict[str, list[float]] = defaultdict(list)
    for _, category, (width_m, height_m, depth_m) in _core.assets():
        ratios[category].append(height_m / max(width_m, depth_m))
    return dict(ratios)
