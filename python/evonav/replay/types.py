"""Describe a replayed episode as plain data, which `evonav.replay.recorder` records and pages show.

What the agent believes and what only the evaluator knows are separate fields: `ReplayedEntry.truth`,
`StageRecord.target`, `StageRecord.transition` and every `is_stale` are the evaluator's.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evonav.agents.agent import PlaceBelief
from evonav.agents.explanation import FrontierBelief
from evonav.evaluation.records.floor_plans import FloorPlan
from evonav.evaluation.records.schema import EntryRecord, RoundRecord, StageRecord
from evonav.points import Point2, Point3
from evonav.world.pose import Pose

UNKNOWN, FREE, BLOCKED, EXPLORED = 0, 1, 2, 3
"""Values of `ReplayedMap.cells`; explored cells are free ones that were seen from close by."""


@dataclass(frozen=True, slots=True)
class Truth:
    """The object behind an entry, as the evaluator knows it."""

    object_id: str
    stood_in_stage: int
    """The last stage in which it stood where the entry is; the present one if the entry is not stale."""
    now_m: Point3 | None
    """Position in the present stage; `None` when it is no longer in the house."""


@dataclass(frozen=True, slots=True)
class ReplayedEntry:
    """An entry of the object memory in one round."""

    record: EntryRecord
    truth: Truth | None
    """`None` when nothing of its label ever stood there."""


@dataclass(frozen=True, slots=True)
class ReplayedView:
    """Colour image of one camera in a round."""

    pose: Pose
    """The camera's, as the agent was given it."""
    jpeg: bytes
    depth_png: bytes | None = None
    """Planar depth in whole millimetres, 16 bits, 0 where there is none; only of a replay that keeps it."""


@dataclass(frozen=True, slots=True)
class ReplayedQuestion:
    """One try at a question."""

    kind: str
    parts: tuple[tuple[str, str | bytes], ...]
    """The prompt: role, and text or an image (JPEG)."""
    answer: str
    """The answer as it came; of a lost one, what happened."""
    outcome: str
    """`answered`, `invalid`, `refusal` or `lost`."""
    offered: tuple[tuple[str, str, int], ...] = ()
    """Meanings of the prompt's numbers: `("Object 0", "Sofa", 12)` or `("Frontier 1", "frontier", 7)`."""


@dataclass(frozen=True, slots=True)
class ReplayedMap:
    """The agent's map in one round."""

    cells: NDArray[np.uint8]
    """`(R, C)`, `[row = z, col = x]`."""
    cell_m: float
    corner_m: Point2
    """`(x, z)` of the smallest corner of cell (0, 0)."""


@dataclass(frozen=True, slots=True)
class ReplayedRound:
    """One round: observation, belief, questions and action."""

    record: RoundRecord | None
    """`None` when the stage errored in this round."""
    pose: Pose
    """Pose of the agent when it observed."""
    views: tuple[ReplayedView, ...]
    """The heading view last."""
    entries: tuple[ReplayedEntry, ...] = ()
    candidate_ids: tuple[int, ...] = ()
    frontiers: tuple[FrontierBelief, ...] = ()
    map: ReplayedMap | None = None
    """`None` for an agent that cannot be inspected."""
    places: PlaceBelief | None = None
    """Belief of where the target is, if the agent has one."""
    questions: tuple[ReplayedQuestion, ...] = ()
    note: str = ""
    """Reason why there is no belief, where the agent should have had one."""


@dataclass(frozen=True, slots=True)
class ReplayedStage:
    """One stage, run again or not."""

    record: StageRecord
    """The replayed one; where nothing was run again, the stored one."""
    floor_plan: FloorPlan | None
    rounds: tuple[ReplayedRound, ...]
    why_not: str
    """Reason why it was not run again; empty if it was."""
    differences: tuple[str, ...]
    """Fields in which the replay departs from what is stored, the first few; none: equal, byte for byte."""
    fov_rad: float
    """Horizontal field of view of a camera."""

    @property
    def is_replayed(self) -> bool:
        """Whether it was run again."""
        return not self.why_not
