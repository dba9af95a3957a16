"""Define the records of a run: one `StageRecord` per stage, one `FloorPlan` per stage house.

A record holds all data that tables, maps and reports need; nothing downstream reads houses, tasks or agents.
A record is a function of the run's inputs: wall-clock times are in a table of their own (`store.py`).
Points are `(x, y, z)` or `(x, z)` in metres, AI2-THOR's world frame; angles are radians.
"""

from dataclasses import dataclass, field
from enum import Enum
from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field

from evonav.agents.agent import AgentAction, EntryBelief, PlaceBelief, SensorConfig
from evonav.points import Point2, Point3, Real
from evonav.records import Record, Version
from evonav.world.pose import Pose

SCHEMA_VERSION = 1
"""Raised whenever a field changes its meaning or vanishes; readers refuse a version they do not know."""


Whole = Annotated[int, Field(ge=-(2**63), lt=2**63)]
"""A count or number of a record: 64 bits."""


class WholeRecord(Record, revalidate_instances="always"):
    """A record whose parts are validated again with the whole: `model_copy` does not validate."""


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


class Relocation(WholeRecord):
    """One object moved in a change. Oracle."""

    object_id: str
    category: str
    from_m: Point3
    to_m: Point3


class TransitionRecord(WholeRecord):
    """A change of the house: between the previous stage and this one, or during this one. Oracle."""

    mode: Literal["SALIENT_OBJECT", "RETAIN_GROUP", "FULL_SHUFFLE"] | None = None
    """`None` when the paper's process changed nothing."""
    room_id: str | None = None
    is_agent_in_room: bool = False
    """True if the agent stands in the evolved room as the house changes: at the start of the stage, or during it."""
    relocations: tuple[Relocation, ...] = ()
    num_added: Whole = 0
    """Objects that an extension added. The two fields below are of extensions, too."""
    num_removed: Whole = 0
    num_states: Whole = 0
    """Doors and objects that opened, closed, or went on or off."""

    @property
    def kind(self) -> str:
        """The mode in lower case, `activities` where people moved things, `extensions` where others did, `static`."""
        if self.mode is not None:
            return self.mode.lower()
        if self.relocations:
            return "activities"
        return "extensions" if self.num_added or self.num_removed or self.num_states else "static"


DURING_STRATA = ("target_moved_during", "changed_during", "unchanged_during")
"""Events during a stage: its target moved, other things changed, or nothing did before the stage ended."""


class ChangeDuringStage(WholeRecord):
    """The change of the house during the stage (docs/extensions.md). Oracle."""

    round: Whole
    """The decision round that was drawn for it."""
    change: TransitionRecord
    """The change as the task has it, whatever of it took place before the stage ended."""
    at_round: Whole | None = None
    """The round of the trace before whose views it took place; `None` if the stage ended before it."""
    skipped_ids: tuple[str, ...] = ()
    """Ids of what did not change in the stage, because the agent stood in the way; it changes after the stage."""
    target_position_m: Point3 | None = None
    """Position of the target once it took place: success is judged by it; `None` if the stage ended before it."""
    is_target_relocated: bool = False
    """The target moved during the stage."""
    path_before_m: Real | None = None
    """Length of the agent's path up to the change."""
    reference_after_m: Real | None = None
    """Length of the shortest path from the agent's place at the change to the target after it; `None` without one."""

    @property
    def stratum(self) -> str:
        """The name in `DURING_STRATA` of what happened during the stage."""
        if self.at_round is None:
            return "unchanged_during"
        return "target_moved_during" if self.is_target_relocated else "changed_during"

    @property
    def done(self) -> tuple[Relocation, ...]:
        """The moves that took place during the stage."""
        if self.at_round is None:
            return ()
        return tuple(one for one in self.change.relocations if one.object_id not in self.skipped_ids)

    @property
    def left(self) -> tuple[Relocation, ...]:
        """The moves that take place after the stage, unseen."""
        done = self.done
        return tuple(one for one in self.change.relocations if one not in done)


@dataclass(frozen=True, slots=True)
class EntryRecord(EntryBelief):
    """An object entry as the agent believed it, judged by the evaluator."""

    is_stale: bool = field(kw_only=True)
    """The entry is stale, as `evonav.evaluation.episode.staleness` defines it."""
    # What comes from an agent was checked at its border, and a stage has hundreds.
    __pydantic_config__ = ConfigDict(strict=True, extra="forbid")


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


class BeliefRecord(Record):
    """The probabilities that an agent stated as a stage began."""

    presence: tuple[tuple[Real, bool], ...] = ()
    """Probabilities that entries' objects are there, each with whether the entry is right.

    They are read before the first round. Entries without one, and those of doors and windows, are left out."""
    places: PlaceBelief | None = None
    """Belief of where the target is, after the first look."""


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


class RoundRecord(Record):
    """One decision round, validated when it is made, and not again with its stage, which may have hundreds."""

    round: Whole
    """0-based."""
    pose: Pose
    """The agent's pose at the observation."""
    action: Annotated[AgentAction, Field(discriminator="kind")]
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

    requested_start: Pose | None = None
    """The pose carried over (stage 1: the manifest's)."""
    effective_start: Pose | None = None
    """The start after snapping to the nearest reachable position; equal to the requested one if that was free."""
    is_snapped: bool = False
    sensing: SensorConfig | None = None
    """The sensors that the agent was granted."""
    terminal: Pose | None = None
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
