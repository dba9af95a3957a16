"""Describe which labels are mistaken for which, and which are seen where nothing is."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, ValidationError

from evonav.errors import InvalidArgumentError
from evonav.records import Record, sentence_of
from evonav.toml import read_toml


@dataclass(frozen=True, slots=True)
class Confusion:
    """A confusion matrix, row by row, and how frequent categories are."""

    categories: tuple[str, ...]
    frequencies: NDArray[np.float64]
    """`(C,)`, adding up to 1."""
    similar: Mapping[str, tuple[tuple[str, ...], NDArray[np.float64]]]
    """Labels that a category is mistaken for, with their shares, by category."""
    group_of: Mapping[str, int]
    """Number of the first group that a category is in, of those that are in any."""

    def another(self, category: str, is_similar: bool, share: float) -> str:
        """Draw the label that a category is mistaken for.

        Args:
            is_similar: Whether from its row of the matrix, if that has entries; otherwise by frequency.
            share: Uniform in 0..1: decides which.
        """
        labels, shares = self.similar.get(category, ((), np.zeros(0)))
        if not is_similar or not labels:
            labels = self.categories
            shares = np.where(np.array(labels) == category, 0.0, self.frequencies)
        return _pick(labels, shares, share) if shares.sum() > 0.0 else category

    def frequent(self, share: float) -> str:
        """Draw a category by frequency; `share`, uniform in 0..1, decides which."""
        return _pick(self.categories, self.frequencies, share)


def _pick(labels: Sequence[str], weights: NDArray[np.float64], share: float) -> str:
    ends = np.cumsum(weights)
    return labels[min(int(np.searchsorted(ends, share * ends[-1], side="right")), len(labels) - 1)]


_Weights = dict[str, Annotated[float, Field(ge=0.0)]]


class _ConfusionFile(Record):
    """Frequencies of categories, groups of similar ones, and how often one is mistaken for another."""

    frequencies: Annotated[_Weights, Field(min_length=1)]
    groups: dict[str, list[str]] = Field(default_factory=dict)
    pairs: dict[str, _Weights] = Field(default_factory=dict)


@cache
def read_confusion(path: str = "") -> Confusion:
    """Read a file of frequencies, groups and pairs (`confusion.toml` shows the form).

    Raises:
        InvalidArgumentError: It cannot be read, or a part of it is malformed.
    """
    name = path or "confusion.toml"
    try:
        file = _ConfusionFile(**read_toml(Path(path) if path else Path(__file__).with_name(name)))
    except ValidationError as error:
        raise InvalidArgumentError(f"{name}: {sentence_of(error)}") from None
    rows: dict[str, dict[str, float]] = {}
    for group in file.groups.values():
        for label in group:
            row = rows.setdefault(label, {})
            for other in group:
                if other != label:
                    row[other] = row.get(other, 0.0) + 1.0
    for label, others in file.pairs.items():
        rows[label] = {**rows.get(label, {}), **others}
    shares = np.array(list(file.frequencies.values()))
    return Confusion(
        categories=tuple(file.frequencies),
        frequencies=shares / shares.sum(),
        similar={
            label: (tuple(row), np.array(list(row.values())) / sum(row.values()))
            for label, row in rows.items()
            if sum(row.values()) > 0.0
        },
        group_of={label: n for n, group in reversed(list(enumerate(file.groups.values()))) for label in group},
    )
