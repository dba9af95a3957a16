"""The constants of the paper's evaluation protocol (Sec. C.1), and what a stage is to the evaluator."""

from dataclasses import dataclass, field

import numpy as np

from evonav.agents.agent import Sensing
from evonav.errors import EvonavError, InvalidArgumentError
from evonav.evaluation.metrics.scoring import SUCCESS_RADIUS_M
from evonav.evaluation.records.costs import StageCosts
from evonav.evaluation.records.schema import (
    EndState,
    ErrorKind,
    FloorPlan,
    GoalRecord,
    Point2,
    StageError,
    StageFailure,
    StageRecord,
    TargetRecord,
    TransitionRecord,
)
from evonav.tasks.public import StageInput
from evonav.world.pose import Pose


class AgentFailedError(EvonavError):
    """An agent in a process of its own has failed: it raised, died, or did not answer in time."""

    def __init__(self, kind: ErrorKind, message: str, traceback: str = "") -> None:
        """An error of one of the kinds that are the agent's own.

        Args:
            kind: Which.
            message: In a line or few.
            traceback: Of the agent's process.
        """
        super().__init__(message)
        self.kind = kind
        self.traceback = traceback


@dataclass(frozen=True, slots=True)
class ProtocolConfig:
    """What every agent of a run is held to."""

    max_rounds: int = 50
    """Decision rounds a stage."""
    max_actions: int = 500
    """Discrete actions a stage, for agents whose `Sensing.motion` is `actions`."""
    success_radius_m: float = SUCCESS_RADIUS_M
    waypoint_m: float = 0.25
    """Longest teleport while following planner waypoints."""
    max_travel_m: float = 1.0
    max_views: int = 7
    """A round; the cap on what an agent may ask for."""
    max_occupancy_range_m: float = 3.0
    min_visible_px: int = 25
    """Pixels from which on the target counts as seen in a view (diagnostics and oracle baselines)."""

    def budget(self, sensing: Sensing) -> int:
        """Rounds of a stage: decisions, or single actions."""
        return self.max_actions if sensing.motion == "actions" else self.max_rounds

    def check(self, sensing: Sensing) -> None:
        """Refuses sensing that the protocol does not grant.

        Raises:
            InvalidArgumentError: The motion is none of the two, a schedule has no or too many views, or travel or range
                exceed the caps.
        """
        if sensing.motion not in ("waypoints", "actions"):
            raise InvalidArgumentError(f"sensing.motion = {sensing.motion!r}: must be `waypoints` or `actions`")
        for name, schedule in (("first_round", sensing.first_round), ("later_rounds", sensing.later_rounds)):
            if not 1 <= schedule.count <= self.max_views:
                raise InvalidArgumentError(f"sensing.{name}.count = {schedule.count}: must be 1..{self.max_views}")
        if not 0.0 < sensing.max_travel_m <= self.max_travel_m:
            raise InvalidArgumentError(
                f"sensing.max_travel_m = {sensing.max_travel_m}: must be in (0, {self.max_travel_m}]"
            )
        if not 0.0 < sensing.occupancy_range_m <= self.max_occupancy_range_m:
            raise InvalidArgumentError(
                f"sensing.occupancy_range_m = {sensing.occupancy_range_m}: must be in (0, {self.max_occupancy_range_m}]"
            )


@dataclass(frozen=True, slots=True)
class GuidedWalk:
    """A reference trajectory that the evaluator walks while the agent looks on."""

    path_m: tuple[Point2, ...]
    """Corners, the start first."""
    end: Pose
    """Where it ends; of its horizon nothing is taken: an agent's camera is as its house has it."""


@dataclass(frozen=True, slots=True)
class StageSpec:
    """A stage as the evaluator knows it; only `public` ever reaches an agent."""

    public: StageInput
    house_json: str
    target: TargetRecord
    transition: TransitionRecord
    forced: GuidedWalk | None = None
    """The stage is not the agent's to walk, and not scored."""

    @property
    def goal(self) -> GoalRecord:
        """What the agent is told, for the record."""
        return GoalRecord(
            category=self.public.category,
            instruction=self.public.unified_instruction,
            basic_instruction=self.public.basic_instruction,
        )


@dataclass(frozen=True, slots=True)
class EpisodeSpec:
    """A task as the evaluator knows it."""

    task_id: str
    house: str
    start: Pose
    """The manifest's, of stage 1."""
    stages: tuple[StageSpec, ...] = field(repr=False)

    def blank_record(self, agent: str, stage: int) -> StageRecord:
        """The record of a stage that was not run; everything else is this plus what happened.

        Args:
            agent: The name it was asked for by.
            stage: 1-based.
        """
        case = self.stages[stage - 1]
        return StageRecord(
            agent=agent,
            task_id=self.task_id,
            house=self.house,
            stage=stage,
            num_stages=len(self.stages),
            state=EndState.NOT_RUN,
            goal=case.goal,
            target=case.target,
            transition=case.transition,
        )


def unknown_case(task_id: str, num_stages: int) -> EpisodeSpec:
    """Stands for a task that cannot be read, so that its stages have records: nothing in it is known."""
    nothing = np.zeros((0, 0, 3), dtype=np.uint8)
    stages = tuple(
        StageSpec(
            public=StageInput(stage, "", "", "", "", nothing),
            house_json="",
            target=TargetRecord(
                object_id="",
                category="",
                position_m=(0.0, 0.0, 0.0),
                room_id="",
                is_relocated=False,
                is_relocated_now=False,
            ),
            transition=TransitionRecord(),
        )
        for stage in range(1, num_stages + 1)
    )
    return EpisodeSpec(task_id, "", Pose(0.0, 0.0, 0.0, 0.0), stages)


@dataclass(frozen=True, slots=True)
class StageOutcome:
    """A finished stage, and what it cost."""

    record: StageRecord
    stage_map: FloorPlan | None
    """Of the stage's house; `None` when the stage never got one."""
    wall_s: float
    cpu_s: float
    traceback: str = ""
    """Of an errored stage."""
    costs: StageCosts | None = None

    @property
    def failure(self) -> StageFailure | None:
        """Why the stage is errored, if it is."""
        record = self.record
        if record.error is None or record.state is not EndState.ERRORED:
            return None
        return StageFailure(record.stage, record.error.kind, record.error.message, self.traceback)


def as_errored(record: StageRecord, kind: ErrorKind, message: str) -> StageRecord:
    """The record with its stage errored; an errored stage has no measures."""
    return record.model_copy(
        update={
            "state": EndState.ERRORED,
            "error": StageError(kind=kind, message=message),
            "spl": None,
            "soft_spl": None,
        }
    )


def as_not_run(record: StageRecord, cause: StageError, stage: int) -> StageRecord:
    """The record of a stage that could not run because an earlier one of its episode is errored."""
    error = StageError(kind=cause.kind, message=f"stage {stage} is errored: {cause.message}")
    return record.model_copy(update={"state": EndState.NOT_RUN, "error": error})
