"""Candidates of MSGNav's questions, earlier choices, and the choice among them."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

from evonav.decision.candidates import ObjectCandidate
from evonav.decision.pictures import Picture
from evonav.points import Point2


@dataclass(frozen=True, slots=True)
class GraphObject:
    """A node of the scene graph."""

    candidate: ObjectCandidate
    room: str
    """The type of room; `others` if it is unknown."""
    neighbour_ids: tuple[int, ...] = ()
    """Ids of entries that are one edge away, ascending."""

    @property
    def entry_id(self) -> int:
        """The id in the object memory."""
        return self.candidate.entry_id


@dataclass(frozen=True, slots=True)
class SeenObject:
    """A detection of an image."""

    label: str
    entry_id: int | None
    """The entry that it belongs to; `None` if it belongs to none, such as a distant object."""
    area_px: int
    centre_m: Point2 | None
    """`(x, z)`; `None` if it has no depth."""


@dataclass(frozen=True, slots=True)
class GraphImage:
    """A stored view: one of the graph's edges, or one of this round."""

    view_id: int
    is_egocentric: bool
    """True if the view is of this round."""
    seen: Sequence[SeenObject]
    """Detections, for models that do not look at images. Not part of the prompt."""
    picture: Picture | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class PastChoice:
    """A choice of an earlier round of this stage that did not lead to the goal."""

    round: int
    kind: Literal["object", "image", "explore"]
    id: int = -1
    """Id of the entry or of the view."""
    category: str = ""
    """The category that the image was said to show."""
    place_m: Point2 | None = None
    """`(x, z)` of the object that was not the goal. Not part of the prompt."""


@dataclass(frozen=True, slots=True)
class GraphChoice:
    """An object of the graph, something in an image, or neither."""

    kind: Literal["object", "image", "explore"]
    id: int = -1
    """Id of the entry, or number of the image."""
    category: str = ""
    """The category to go to in the image."""
