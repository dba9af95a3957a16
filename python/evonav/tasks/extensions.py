"""What goes beyond the paper: the part of Θ that is off by default (docs/extensions.md)."""

from typing import Annotated

from pydantic import Field

from evonav.tasks.records import Probability, Record


class Occurrence(Record):
    """How often something happens at a transition, and to how much."""

    probability: Probability
    max_count: Annotated[int, Field(ge=1, le=64)]
    """If it happens, to how many: uniform from 1 to this."""


class Schedule(Record):
    """Who lives in the house, and how."""

    num_persons: Annotated[int, Field(ge=1, le=16)]
    minutes_between_stages: Annotated[int, Field(ge=1, le=10_080)]
    tidiness: Probability
    """Chance that a used thing is brought back when its activity ends."""


class Extensions(Record):
    """Each is off where `None`."""

    insertion: Occurrence | None = None
    """Small things that appear."""
    removal: Occurrence | None = None
    """Small things that vanish."""
    doors: Occurrence | None = None
    """Doors that open or close."""
    openables: Occurrence | None = None
    """Furniture and things that open or close."""
    switches: Occurrence | None = None
    """Lamps and screens that go on or off."""
    schedule: Schedule | None = None
    """People who use things, instead of the paper's independent draws of rooms."""
