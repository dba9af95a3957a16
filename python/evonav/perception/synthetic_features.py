"""Features that compare as CLIP's do, made from names: no model behind them.

A feature of an image is a unit vector with a part that all images share, one of its category (which similar categories
share in part), one of the object and one of the view. That of a text has a part that all texts share, at an angle to
that of the images (CLIP's modality gap), one of the categories it speaks of, and one of the text. The shares are such
that cosines are distributed as those of CLIP ViT-B/32 (docs/perception.md).
"""

import re
from functools import cache

import numpy as np
from numpy.typing import NDArray

from evonav import _core
from evonav.perception.noise import Confusion
from evonav.tasks.language import noun_of, plural_of

DIMENSIONS = 64
IMAGES, CATEGORY, OBJECT, VIEW = 0.53, 0.22, 0.10, 0.15
"""Shares of an image feature's squared length; they add up to 1."""
GROUP = 0.5
"""Share of a category's part that it has in common with similar ones."""
TEXTS, NOUNS = 0.86, 0.03
"""Shares of a text feature's squared length; the rest is the text's own."""
GAP = 0.28
"""Cosine of the parts that all images and all texts share."""
OTHER_NOUN = 0.35
"""Weight of a noun that is not the first."""

F64 = NDArray[np.float64]


def image_feature(labels: tuple[str, ...], confusion: Confusion, thing: F64, view: F64, noise: float) -> F64:
    """Return the `(64,)` unit feature of a detection.

    Args:
        labels: The true category and, where it is another, the label that it was given: it looks like both.
        confusion: Says which categories are similar.
        thing: `(62,)` normals of the object.
        view: `(62,)` normals of the view.
        noise: Scale of the view's share.
    """
    category_part = _unit(np.sum([_category(label, confusion.group_of.get(label, -1)) for label in labels], axis=0))
    parts = [(CATEGORY, category_part), (OBJECT, _unit(thing)), (VIEW * noise, _unit(view))]
    meaning = sum((np.sqrt(share) * part for share, part in parts), np.zeros(DIMENSIONS - 2))
    return _unit(np.array([np.sqrt(IMAGES), 0.0, *meaning]))


def text_feature(text: str, confusion: Confusion) -> NDArray[np.float32]:
    """Return the `(64,)` unit feature of a text, made from the categories that it names; the first weighs most."""
    found = nouns_of(text, confusion.categories)
    named = np.zeros(DIMENSIONS - 2)
    for place, label in enumerate(found):
        named += (OTHER_NOUN if place else 1.0) * _category(label, confusion.group_of.get(label, -1))
    own = _unit(_normals("text", text))
    shares = (NOUNS, 1.0 - TEXTS - NOUNS) if found else (0.0, 1.0 - TEXTS)
    meaning = np.sqrt(shares[0]) * _unit(named) + np.sqrt(shares[1]) * own
    common = np.sqrt(TEXTS) * np.array([GAP, np.sqrt(1.0 - GAP**2)])
    return _unit(np.array([*common, *meaning])).astype(np.float32)


def nouns_of(text: str, categories: tuple[str, ...]) -> list[str]:
    """Return the categories that a text names, each once, in order."""
    pattern, by_noun = _nouns(categories)
    return list(dict.fromkeys(by_noun[match.lower()] for match in pattern.findall(text)))


@cache
def _nouns(categories: tuple[str, ...]) -> tuple[re.Pattern[str], dict[str, str]]:
    by_noun = {plural_of(noun_of(label)).lower(): label for label in categories}
    by_noun |= {noun_of(label).lower(): label for label in categories}
    longest_first = sorted(map(re.escape, by_noun), key=len, reverse=True)
    return re.compile(rf"\b(?:{'|'.join(longest_first)})\b", re.IGNORECASE), by_noun


@cache
def _category(label: str, group: int) -> F64:
    own = _unit(_normals("category", label))
    if group < 0:
        return own
    return _unit(np.sqrt(GROUP) * _unit(_normals("group", str(group))) + np.sqrt(1.0 - GROUP) * own)


def _normals(*labels: str) -> F64:
    """Draw normals that are the same for all runs, as a model's weights are."""
    (drawn,) = _core.draw_normals(0, [["feature", *labels]], num_draws=DIMENSIONS - 2)
    return np.asarray(drawn, np.float64)


def _unit(vector: F64) -> F64:
    unit: F64 = vector / max(float(np.linalg.norm(vector)), 1e-12)
    return unit
