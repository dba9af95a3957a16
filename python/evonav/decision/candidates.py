"""Candidates that questions offer."""

from dataclasses import dataclass, field
from typing import Literal

from evonav.decision.pictures import Picture
from evonav.memory.colours import Layout
from evonav.points import Point2, Point3


@dataclass(frozen=True, slots=True)
class ObjectAppearance:
    """The appearance of a remembered object in its three largest views and its latest one."""

    colours: tuple[float, ...]
    """Share of each of `evonav.tasks.language.COLOURS`, the mean over its largest views."""
    shown_ids: frozenset[int]
    """Ids of the entries in these views."""
    known_share: float
    """Share of the cells within a metre of it that the map knows."""
    layout: Layout | None = None
    """Colours around it, the mean over its largest views, if agents go by the goal's picture."""


@dataclass(frozen=True, slots=True)
class ObjectCandidate:
    """A remembered object: a label and an axis-aligned box, with images if the model looks at them."""

    entry_id: int
    label: str
    centre_m: Point3
    size_m: Point3
    num_detections: int
    crop: Picture | None = field(default=None, compare=False, repr=False)
    """The object, cut out of its best view."""
    view: Picture | None = field(default=None, compare=False, repr=False)
    """The view in which the object was last seen."""
    appearance: ObjectAppearance | None = field(default=None, compare=False, repr=False)
    """Its appearance, if the decision model asks for colours."""

    @property
    def ground_m(self) -> Point2:
        """`(x, z)` of its middle."""
        return (self.centre_m[0], self.centre_m[2])


@dataclass(frozen=True, slots=True)
class FrontierCandidate:
    """A place from which unexplored space can be seen."""

    frontier_id: int
    position_m: Point2
    travel_m: float
    """Distance from the agent: along its map for rules that look, else straight."""
    image: Picture | None = field(default=None, compare=False, repr=False)
    """The view towards the frontier."""
    is_current: bool = False
    """Whether the agent is on its way there."""


@dataclass(frozen=True, slots=True)
class Choice:
    """One of a question's objects or frontiers."""

    kind: Literal["object", "frontier"]
    index: int
