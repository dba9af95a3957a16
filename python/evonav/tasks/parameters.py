"""Define the generator's hyperparameters: those of the paper, and those of the extensions beyond it."""

import json
from typing import Annotated, Any

from pydantic import Field, NonNegativeFloat, PositiveFloat, PositiveInt

from evonav import _core
from evonav.records import Record
from evonav.tasks.records import Probability
from evonav.world.simulator import Style

# The core holds the default values, see `Parameters` in `evonav_core::generation`.
_DEFAULTS: dict[str, Any] = json.loads(_core.default_generation_parameters())


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


class DuringStage(Record):
    """Frequency of changes during a stage, and their rounds."""

    probability: Probability
    """Probability that the house changes during a stage."""
    rounds: tuple[Annotated[int, Field(ge=1, le=49)], Annotated[int, Field(ge=1, le=49)]]
    """First and last decision round, from 0, in which it may change; the round is drawn uniformly."""


class Extensions(Record):
    """The extensions beyond the paper (docs/extensions.md); each is off if `None`, which is the default."""

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
    during_stage: DuringStage | None = None
    """Changes during a stage."""


class GenerationParameters(Record):
    """The fixed hyperparameters Θ (paper, Sec. A.2), and those that the paper leaves open."""

    num_stages: Annotated[tuple[PositiveInt, ...], Field(min_length=1)] = tuple(_DEFAULTS["num_stages"])
    """Possible numbers of stages K, drawn uniformly (the paper gives the range only)."""
    evolve_probability: Probability = _DEFAULTS["evolve_probability"]
    visited_factor: NonNegativeFloat = _DEFAULTS["visited_factor"]
    recently_changed_factor: NonNegativeFloat = _DEFAULTS["recently_changed_factor"]
    changed_room_window: PositiveInt = _DEFAULTS["changed_room_window"]
    """Number of transitions back in which a change counts as recent (the paper's k-2, counted by first stage)."""
    salient_object_probability: Probability = _DEFAULTS["salient_object_probability"]
    retain_group_probability: Probability = _DEFAULTS["retain_group_probability"]
    full_shuffle_probability: Probability = _DEFAULTS["full_shuffle_probability"]
    changed_room_multiplier: NonNegativeFloat = _DEFAULTS["changed_room_multiplier"]
    previous_goal_room_multiplier: NonNegativeFloat = _DEFAULTS["previous_goal_room_multiplier"]
    goal_room_window: Annotated[int, Field(ge=1, le=64)] = _DEFAULTS["goal_room_window"]
    """Number of stages back whose goal rooms have that multiplier, once for each.

    The paper's Sec. A.2 says 2, its Sec. 3.2 "the previous stage".
    """
    moved_object_multiplier: NonNegativeFloat = _DEFAULTS["moved_object_multiplier"]
    moved_children_multiplier: NonNegativeFloat = _DEFAULTS["moved_children_multiplier"]
    """Multiplier for objects that stood on the salient object and moved with it.

    The paper gives 9 to "the moved object". With 1 here, too few goals are relocated (docs/studies/task-statistics.md).
    """
    goals_on_walls: bool = _DEFAULTS["goals_on_walls"]
    """Whether objects on walls, which no modification moves, may be goals.

    The paper uses them as anchors of instructions. Without them as goals, the share of relocated goals (Sec. 3.2) is
    the published one.
    """
    reference_min_m: PositiveFloat = _DEFAULTS["reference_min_m"]
    reference_max_m: PositiveFloat = _DEFAULTS["reference_max_m"]
    reference_image_px: Annotated[int, Field(ge=16, le=4096)] = _DEFAULTS["reference_image_px"]
    reference_style: Style = _DEFAULTS["reference_style"]
    """Way in which reference images are drawn."""
    reference_min_visible_px: PositiveInt = _DEFAULTS["reference_min_visible_px"]
    """Smallest number of pixels of a visible target (the paper says "visible")."""
    relocated_min_m: NonNegativeFloat = _DEFAULTS["relocated_min_m"]
    placement_tries: PositiveInt = _DEFAULTS["placement_tries"]
    """Number of places tried for an object before it stays where it is."""
    modification_tries: Annotated[int, Field(ge=1, le=1000)] = _DEFAULTS["modification_tries"]
    """Number of attempts at a room's modification, with new places, before it is abandoned."""
    extensions: Extensions = Extensions()
