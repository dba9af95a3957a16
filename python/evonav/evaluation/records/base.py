"""Define the numbers and points of records, and the record of an agent's probabilities."""

from collections.abc import Mapping
from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, ConfigDict, Field

CheckedT = TypeVar("CheckedT", bound="CheckedRecord")

Real = Annotated[float, Field(ge=-1e9, le=1e9)]
"""Metres, radians or degrees, far beyond any house. Sums and squares of such numbers are finite."""
Whole = Annotated[int, Field(ge=-(2**63), lt=2**63)]
"""A count or number of a record: 64 bits."""
Point2 = tuple[Real, Real]
"""`(x, z)`."""
Point3 = tuple[Real, Real, Real]
"""`(x, y, z)`."""


class Record(BaseModel):
    """A frozen record that rejects unknown fields."""

    # Parts of a record are validated again with the whole: `model_copy` does not validate.
    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        ser_json_inf_nan="null",
        revalidate_instances="always",
        allow_inf_nan=False,
        defer_build=True,
    )


class CheckedRecord(Record, revalidate_instances="never"):
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


class BeliefRecord(Record):
    """The probabilities that an agent stated as a stage began."""

    presence: tuple[tuple[Real, bool], ...] = ()
    """Probabilities that entries' objects are there, each with whether the entry is right.

    They are read before the first round. Entries without one, and those of doors and windows, are left out."""
    places: PlacesRecord | None = None
    """Belief of where the target is, after the first look."""
