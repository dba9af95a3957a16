"""What agents ask a decision model, and what it may answer.

Typed on both sides, so that a rule, a recording and a VLM are interchangeable. Nothing here is oracle data: candidates
are what the agent itself remembers.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

from evonav.tasks.public import StageInput

Point2 = tuple[float, float]
"""`(x, z)` in metres."""
Point3 = tuple[float, float, float]
"""`(x, y, z)` in metres."""


@dataclass(frozen=True, slots=True)
class ObjectCandidate:
    """A remembered object: a label and an axis-aligned box."""

    entry_id: int
    label: str
    centre_m: Point3
    size_m: Point3
    num_detections: int


@dataclass(frozen=True, slots=True)
class FrontierCandidate:
    """A place from which unexplored space can be seen."""

    frontier_id: int
    position_m: Point2
    travel_m: float
    """Distance from the agent."""


@dataclass(frozen=True, slots=True)
class ChooseQuestion:
    """Where to go next: one of the objects, or one of the frontiers?"""

    goal: StageInput
    position_m: Point2
    """Of the agent."""
    objects: Sequence[ObjectCandidate]
    """Best first, by `DecisionModel.rank`."""
    frontiers: Sequence[FrontierCandidate]
    surroundings: Sequence[ObjectCandidate]
    """Everything remembered: what the candidates' images would show around them."""
    num_rounds_left: int


@dataclass(frozen=True, slots=True)
class Choice:
    """`object` or `frontier` with an index into the question's candidates, or `none` if nothing fits."""

    kind: Literal["object", "frontier", "none"]
    index: int = 0
    reason: str = ""

    def is_valid(self, question: ChooseQuestion) -> bool:
        """Whether the index is one of the question's."""
        counts = {"object": len(question.objects), "frontier": len(question.frontiers), "none": 1}
        return 0 <= self.index < counts.get(self.kind, 0)


@dataclass(frozen=True, slots=True)
class Sighting:
    """An object in a present view, compared with a remembered one."""

    label: str
    overlap: float
    """Share of its points that lie by the remembered object's."""
    distance_m: float
    """From its centroid to the middle of the remembered object's box; `inf` if it cannot be told."""


@dataclass(frozen=True, slots=True)
class VerifyQuestion:
    """Does the present view support that the remembered object is still here?"""

    goal: StageInput
    entry: ObjectCandidate
    seen: Sequence[Sighting]
    """What the present views show."""
    image_share: float
    """Share of the present view that the remembered object's box would cover if nothing hid it."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """The answer to a `VerifyQuestion`."""

    is_present: bool
    reason: str = ""


class DecisionModel(Protocol):
    """Answers an agent's questions."""

    def rank(self, goal: StageInput, entries: Sequence[ObjectCandidate], position_m: Point2) -> list[int]:
        """Indices of the entries that may be the goal or lead to it, best first; the rest is left out."""
        ...

    def choose(self, question: ChooseQuestion) -> Choice:
        """Where to go next.

        Raises:
            DecisionError: The model gives no usable answer.
        """
        ...

    def verify(self, question: VerifyQuestion) -> Verdict:
        """Whether a remembered object is still there.

        Raises:
            DecisionError: The model gives no usable answer.
        """
        ...
