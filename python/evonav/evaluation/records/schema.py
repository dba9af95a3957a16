"""Define the records of a run: one `StageRecord` per stage, one `FloorPlan` per stage house.

A record holds all data that tables, maps and reports need; nothing downstream reads houses, tasks or agents.
A record is a function of the run's inputs: wall-clock times are in a table of their own (`store.py`).
Points are `(x, y, z)` or `(x, z)` in metres, AI2-THOR's world frame; angles are radians.
"""

from dataclasses import dataclass
from enum import Enum
from typing import Annotated, Any, Literal

from pydantic import Field

from evonav.evaluation.records.base import BeliefRecord, CheckedRecord, Whole, WholeRecord
from evonav.evaluation.records.changes import ChangeDuringStage, TransitionRecord
from evonav.points import Point2, Point3, Real
from evonav.records import Version

SCHEMA_VERSION = 1
"""Raised whenever a field changes its meaning or vanishes; readers refuse a version they do not know."""


class EndState(str, Enum):
    """The way a stage ended. Rates are over `success` and `failure` alone."""

    SUCCESS = "success"
    FAILURE = "failure"
    ERRORED = "errored"
    NOT_RUN = "not_run"
    GUIDED = "guided"
    """The evaluator moved the agent along a reference trajectory: there is nothing to score (docs/controlled.md)."""

    @property
    def is_scored(self) -> bool:
        """True if the stage counts in rates."""
        return self in (EndState.SUCCESS, EndState.FAILURE)


class ErrorKind(str, Enum):
    """The part of the system that caused an error."""

    AGENT = "agent"
    """The agent raised, or answered with what is no action."""
    DECISION = "decision"
    """The decision model gave no valid answer."""
    SIMULATION = "simulation"
    """The simulator raised."""
    SIMULATOR_LOST = "simulator_lost"
    """The simulator's process ended or hung, every time that the stage was tried."""
    REFERENCE = "reference"
    """There is no path from the effective start to the target, so SPL is undefined."""
    CRASH = "crash"
    """The agent's process died, or the worker's."""
    TIMEOUT = "timeout"
    """The agent did not answer, or the stage did not end, within the time that the run allows."""
    HARNESS = "harness"
    """Anything else: a task that cannot be read, a bug in evonav."""

    @property
    def phrase(self) -> str:
        """The cause in words, such as `the agent failed`."""
        return _PHRASES[self]

    @property
    def is_agents(self) -> bool:
        """True if the agent caused the error: such a failure costs its stage, and the episode continues."""
        return self in (ErrorKind.AGENT, ErrorKind.DECISION) or self.loses_memory

    @property
    def loses_memory(self) -> bool:
        """True if the agent's process ended, and its memory with it."""
        return self in (ErrorKind.CRASH, ErrorKind.TIMEOUT)


_PHRASES = {
    ErrorKind.AGENT: "the agent failed",
    ErrorKind.DECISION: "the decision model gave no valid answer",
    ErrorKind.SIMULATION: "the simulator failed",
    ErrorKind.SIMULATOR_LOST: "the simulator's process was lost",
    ErrorKind.REFERENCE: "there is no path to the target",
    ErrorKind.CRASH: "the agent's process died",
    ErrorKind.TIMEOUT: "no answer came in time",
    ErrorKind.HARNESS: "the task cannot be read, or evonav failed",
}


class StageError(WholeRecord):
    """The reason why a stage is errored or was not run."""

    kind: ErrorKind
    message: str


@dataclass(frozen=True, slots=True)
class StageFailure:
    """An attempt at a stage that has failed."""

    stage: int
    """1-based; 0 stands for the first stage that did not end."""
    kind: ErrorKind
    message: str
    traceback: str = ""


class PoseRecord(CheckedRecord):
    """A pose of the agent."""

    x_m: Real
    y_m: Real
    z_m: Real
    yaw_rad: Real
    horizon_rad: Real


class GoalRecord(WholeRecord):
    """The goal that the agent received, without the image."""

    category: str
    instruction: str
    """The stage input of the reported experiments: the unified instruction."""
    basic_instruction: str


class TargetRecord(WholeRecord):
    """The instance to be found. Oracle."""

    object_id: str
    category: str
    position_m: Point3
    room_id: str
    is_relocated: bool
    """Ever moved since stage 1: the paper's relocated-target split (it leaves stage 1 out of both strata)."""
    is_relocated_now: bool
    """Moved in the transition just before this stage."""
    first_position_m: Point3 | None = None
    """Its place in stage 1, if `is_relocated`."""


class EntryRecord(CheckedRecord):
    """An object entry as the agent believed it, judged by the evaluator."""

    entry_id: Whole
    label: str
    centre_m: Point3
    size_m: Point3
    num_detections: Whole
    is_stale: bool
    """The entry is stale, as `evonav.evaluation.episode.staleness` defines it."""


class MemoryRecord(WholeRecord):
    """The agent's entries compared with the stage's house."""

    num_entries: Whole
    num_right: Whole
    """Entries that are right, as `evonav.evaluation.episode.staleness` defines it: the others are stale."""
    num_held: Whole
    """Objects that right entries stand for, each with the nearest one of its label."""
    num_seen: Whole
    """Objects of the house that were in view so far in the episode."""
    num_seen_held: Whole
    """Seen objects that a right entry stands for."""
    position_error_m: Real | None
    """Mean distance of right entries' centres from those of their objects' boxes; `None` without any."""


class StaleEntryRecord(WholeRecord):
    """An entry that was stale at the start, the round from which this was evident, and the round of its correction."""

    label: str
    centre_m: Point3
    evident_round: Whole | None = None
    """The first round whose views show that its place is empty."""
    cleared_round: Whole | None = None
    """The round, from the evident one on, after which the entry is gone or corrected."""


class MovedObjectRecord(WholeRecord):
    """An object moved in the transition before the stage, far enough that an entry of it would be stale."""

    object_id: str
    seen_round: Whole | None = None
    """The first round in which it is in view at its new place."""
    found_round: Whole | None = None
    """The round, from that one on, after which an entry stands for it."""


class ActionRecord(CheckedRecord):
    """The agent's answer."""

    kind: Literal["move", "navigate_to", "stop"]
    action: str | None = None
    """The action of a `move`: `MOVE_FORWARD`, `TURN_LEFT`, `TURN_RIGHT` or `STOP`."""
    position_m: Point2 | None = None
    """The destination of a `navigate_to`."""
    face_m: Point2 | None = None
    """The point that the agent of a `navigate_to` turns towards on arrival, if given."""
    reason: str | None = None
    """The reason of a `stop`."""


class SensingRecord(WholeRecord):
    """The sensing and motion that the agent was granted in a stage, without colours.

    Together with the actions, this is enough to carry them out again (`evonav.submission.rescore`).
    """

    first_round: tuple[Whole, Real]
    """Views, and degrees between them."""
    later_rounds: tuple[Whole, Real]
    motion: Literal["waypoints", "actions"]
    max_travel_m: Real
    occupancy_range_m: Real


class RoundRecord(CheckedRecord):
    """One decision round: where the agent stood, what it chose, how it went."""

    round: Whole
    """0-based."""
    pose: PoseRecord
    """The agent's pose at the observation."""
    action: ActionRecord
    path_m: tuple[Point2, ...]
    """Waypoints travelled, the pose's own position first; a single point when the agent stood still."""
    is_action_success: bool
    is_target_visible: bool
    """True if the target was in one of this round's views."""
    choice: str
    """The choice as the agent describes it: `object 12`, `frontier 3`, `none`."""
    chosen_entry: EntryRecord | None
    num_entries: Whole
    num_frontiers: Whole
    counters: dict[str, Whole]
    """Cumulative over the task, such as `conflicts` or `rejected_entries`."""
    details: dict[str, Any]


class StageRecord(WholeRecord):
    """One stage of one agent's episode. Metrics are `None` unless the state is success or failure."""

    schema_version: Version = 1
    agent: str
    """The name by which the agent was requested: `fu`, `stage-reset`, `my_package:MyAgent`."""
    task_id: str
    house: str
    stage: Annotated[Whole, Field(ge=1)]
    num_stages: Whole
    state: EndState
    error: StageError | None = None
    failed_before: tuple[Whole, ...] = ()
    """Earlier stages of the episode in which the agent failed: it may know less than otherwise."""
    memory_lost_at: Whole | None = None
    """The last stage, up to this one, that the agent began again, without memory: its process was lost before."""
    goal: GoalRecord
    target: TargetRecord
    transition: TransitionRecord
    during: ChangeDuringStage | None = None
    """`None` for a task without a change during the stage."""

    requested_start: PoseRecord | None = None
    """The pose carried over (stage 1: the manifest's)."""
    effective_start: PoseRecord | None = None
    """The start after snapping to the nearest reachable position; equal to the requested one if that was free."""
    is_snapped: bool = False
    sensing: SensingRecord | None = None
    terminal: PoseRecord | None = None
    num_rounds: Whole = 0
    has_stopped: bool = False
    """The agent ended the stage itself (otherwise the budget did). Success needs no stop (paper, Sec. C.2)."""
    stop_reason: str = ""
    start_distance_m: Real | None = None
    """Ground-plane distance to the target at the effective start."""
    terminal_distance_m: Real | None = None
    """Ground-plane distance to the target at the end: the success criterion."""
    path_length_m: Real | None = None
    """L_k: length of the executed polyline on the ground plane."""
    reference_length_m: Real | None = None
    """L*_k: shortest path from the effective start to the target."""
    spl: Real | None = None
    soft_spl: Real | None = None
    """SPL with success replaced by the share of the start distance that was covered."""
    num_target_visible_rounds: Whole = 0

    reference_ring_m: Real | None = None
    """The part of the reference path that lies outside of the success radius; 0 for a start within it."""
    terminal_box_distance_m: Real | None = None
    """Ground-plane distance to the target's box at the end."""
    terminal_geodesic_m: Real | None = None
    """Length of the shortest path to the target at the end; `None` where there is none."""
    is_geodesic_success: bool | None = None
    """True if that is shorter than the success radius."""
    memory_at_start: MemoryRecord | None = None
    """The memory after the agent received the goal; like the next fields, `None` for an agent without entries."""
    memory_at_end: MemoryRecord | None = None
    num_forgotten: Whole | None = None
    """Objects that an entry stood for at the start and none at the end, though they stand where they stood."""
    belief_at_start: BeliefRecord | None = None
    """`None` for an agent that tells no probabilities."""
    stale_entries: tuple[StaleEntryRecord, ...] = ()
    moved_objects: tuple[MovedObjectRecord, ...] = ()

    trace: tuple[RoundRecord, ...] = ()
    entries: tuple[EntryRecord, ...] = ()
    """The agent's object memory at the end of the stage."""

    @property
    def is_scored(self) -> bool:
        """True if the stage counts in rates."""
        return self.state.is_scored

    @property
    def mode(self) -> str:
        """The kind of the transition before the stage (`TransitionRecord.kind`); `first` in stage 1."""
        return "first" if self.stage == 1 else self.transition.kind

    @property
    def stratum(self) -> str:
        """The paper's: `relocated` if the target ever moved since stage 1; `stage_1` is in neither of the others."""
        later = "relocated" if self.target.is_relocated else "not_relocated"
        return "stage_1" if self.stage == 1 else later

    @property
    def during_stratum(self) -> str | None:
        """`ChangeDuringStage.stratum`; `None` without a change during the stage in the task."""
        return None if self.during is None else self.during.stratum

    @property
    def target_m_at_end(self) -> Point3:
        """The target's position as the stage ends, by which success is judged."""
        during = self.during
        return self.target.position_m if during is None or not during.target_position_m else during.target_position_m
