"""Describe which labels are mistaken for which, and which are seen where nothing is."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evonav.errors import InvalidArgumentError
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


@cache
def read_confusion(path: str = "") -> Confusion:
    """Read a file of frequencies, groups and pairs (`confusion.toml` shows the form).

    Raises:
        InvalidArgumentError: It cannot be read, or a part of it is malformed.
    """
    name = path or "confusion.toml"
    raw = read_toml(Path(path) if path else Path(__file__).with_name(name))
    if set(raw) - {"frequencies", "groups", "pairs"}:
        raise InvalidArgumentError(f"{name}: expected frequencies, groups and pairs, and nothing else")
    groups = raw.get("groups", {})
    if not isinstance(groups, dict) or not all(
        isinstance(group, list) and all(isinstance(label, str) for label in group) for group in groups.values()
    ):
        raise InvalidArgumentError(f"{name}: groups: expected lists of categories by name")
    frequencies = _weights(raw.get("frequencies"), f"{name}: frequencies")
    if not frequencies:
        raise InvalidArgumentError(f"{name}: frequencies: expected at least one category")
    rows: dict[str, dict[str, float]] = {}
    for group in groups.values():
        for label in group:
            row = rows.setdefault(label, {})
            for other in group:
                if other != label:
                    row[other] = row.get(other, 0.0) + 1.0
    pairs = raw.get("pairs", {})
    if not isinstance(pairs, dict):
        raise InvalidArgumentError(f"{name}: pairs: expected a table of weights by category")
    for label, others in pairs.items():
        rows[label] = {**rows.get(label, {}), **_weights(others, f"{name}: pairs.{label}")}
    shares = np.array(list(frequencies.values()))
    return Confusion(
        categories=tuple(frequencies),
        frequencies=shares / shares.sum(),
        similar={
            label: (tuple(row), np.array(list(row.values())) / sum(row.values()))
            for label, row in rows.items()
            if sum(row.values()) > 0.0
        },
        group_of={label: n for n, group in reversed(list(enumerate(groups.values()))) for label in group},
    )


def _weights(table: Any, place: str) -> dict[str, float]:  # noqa: ANN401 - as read
    if not isinstance(table, dict):
        raise InvalidArgumentError(f"{place}: expected a table of weights by category")
    for label, weight in table.items():
        is_number = isinstance(weight, int | float) and not isinstance(weight, bool)
        if not isinstance(label, str) or not is_number or not math.isfinite(weight) or weight < 0:
            raise InvalidArgumentError(f"{place}.{label} = {weight!r}: expected a weight, 0 or more")
    return {label: float(weight) for label, weight in table.items()}
