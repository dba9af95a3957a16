"""Define the numbers and points of records, and the record of an agent's probabilities."""

from collections.abc import Mapping
from typing import Annotated, Any, TypeVar

from pydantic import Field

from evonav.points import Point2, Real
from evonav.records import Record

CheckedT = TypeVar("CheckedT", bound="CheckedRecord")

Whole = Annotated[int, Field(ge=-(2**63), lt=2**63)]
"""A count or number of a record: 64 bits."""


class WholeRecord(Record, revalidate_instances="always"):
    """A record whose parts are validated again with the whole: `model_copy` does not validate."""


class CheckedRecord(Record):
    """A part of a record that is validated when it is made or copied, and not again: a stage has hundreds."""

    def model_copy(self: CheckedT, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> CheckedT:
        """Return a copy, validated if some values are others."""
        copy = super().model_copy(deep=deep)
        return copy if update is None else self.model_validate(dict(copy) | dict(update))


class PlacesRecord(CheckedRecord):
    """Belief of an agent of where the target is: see `evonav.agents.agent.PlaceBelief`."""

    cell_m: Real
    centres_m: tuple[Point2, ...]
    probabilities: tuple[Real, ...]


class BeliefRecord(WholeRecord):
    """The probabilities that an agent stated as a stage began."""

    presence: tuple[tuple[Real, bool], ...] = ()
    """Probabilities that entries' objects are there, each with whether the entry is right.

    They are read before the first round. Entries without one, and those of doors and windows, are left out."""
    places: PlacesRecord | None = None
    """Belief of where the target is, after the first look."""
