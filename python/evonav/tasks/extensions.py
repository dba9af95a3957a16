"""Parameters of the extensions beyond the paper, which are off by default (docs/extensions.md)."""

from typing import Annotated

from pydantic import Field

from evonav.tasks.records import Probability, Record


class Occurrence(Record):
    """Frequency of an event at a transition, and the number of objects affected."""

    probability: Probability
    max_count: Annotated[int, Field(ge=1, le=64)]
    """Largest number of objects affected; the number is drawn uniformly from 1 to this."""


class Schedule(Record):
    """The people of the house and their habits."""

    num_persons: Annotated[int, Field(ge=1, le=16)]
    minutes_between_stages: Annotated[int, Field(ge=1, le=10_080)]
    tidiness: Probability
    """Probability that a used object is brought back when its activity ends."""


class Extensions(Record):
    """The extensions; each is off if `None`."""

    insertion: Occurrence | None = None
    """Small objects that appear."""
    removal: Occurrence | None = None
    """Small objects that vanish."""
    doors: Occurrence | None = None
    """Doors that open or close."""
    openables: Occurrence | None = None
    """Furniture and objects that open or close."""
    switches: Occurrence | None = None
    """Lamps and screens that are switched on or off."""
    schedule: Schedule | None = None
    """People who use objects, instead of the paper's independent draws of rooms."""
