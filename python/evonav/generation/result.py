"""Define the core's JSON record of one run of Algorithm 1 (`evonav_core::generation`)."""

from typing import Annotated, Literal

from pydantic import Field, NonNegativeInt

from evonav.records import Record
from evonav.tasks.dataset import RejectReason
from evonav.tasks.oracle import OracleFields
from evonav.tasks.records import Id


class Anchor(Record):
    """An object or part of a room that an instruction refers to."""

    category: Id
    determiner: Literal["the", "a", "some"]


class Relations(Record):
    """The surroundings of a target, in categories."""

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
    """Number of objects in the house that fit all of this, read literally; the target is one of them."""


class Tint(Record):
    """The colour of a material in the reference image."""

    colour: tuple[int, int, int]
    """sRGB, 0 to 255."""
    share: float
    """Share of the target's pixels, 0 to 1."""


class Detail(Record):
    """A part of a target's shape."""

    noun: str
    count: int


class Appearance(Record):
    """The appearance of a target."""

    tints: tuple[Tint, ...] = ()
    """Colours in the reference image, the largest share first."""
    form: str | None = None
    """`round`, `L-shaped` or `U-shaped`, if objects of its category also have other forms."""
    details: tuple[Detail, ...] = ()
    made_of: tuple[str, ...] = ()
    """Materials, the most important first."""


class GeneratedStage(OracleFields):
    """A stage, and what its instructions are written from."""

    appearance: Appearance
    relations: Relations


class GeneratedTask(Record):
    """The stages of a task."""

    stages: tuple[GeneratedStage, ...]


class RejectedHouse(Record):
    """The reason why a house gives no task."""

    reason: RejectReason
    stage: NonNegativeInt
    """Stage at which the reason was found; 0 before the first."""
    detail: str


class GenerationResult(Record):
    """The outcome of Algorithm 1 for a house: either a task or a rejection."""

    task: GeneratedTask | None = None
    rejected: RejectedHouse | None = None


class GivenStage(Record):
    """The parts of a stage that are given instead of drawn."""

    goal_id: str | None = None
    """Id of the goal object."""
    is_evolved: bool | None = None
    """Whether the transition before the stage evolves the house."""
