"""Carries recorded actions out again: what a run's records say must come of them, byte for byte.

No agent runs: one that holds the records answers what they say was answered, and says of itself what they say it said.
Poses, paths, what was in view, what is stale, distances, SPL and success are the evaluator's, and made anew.
"""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from evonav.agents.agent import (
    AgentAction,
    EntryBelief,
    Move,
    NavigateTo,
    RoundDiagnostics,
    Sensing,
    Stop,
    ViewSchedule,
)
from evonav.errors import InvalidArgumentError
from evonav.evaluation.episode.episode import Episode
from evonav.evaluation.episode.spec import EpisodeSpec
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.json_diff import record_differences
from evonav.evaluation.records.schema import ActionRecord, EntryRecord, StageRecord
from evonav.evaluation.run.components import Backend
from evonav.perception import Percept, StageScene
from evonav.sensors.observation import Detections, Observation
from evonav.tasks.public import StageInput, TaskInfo
from evonav.world.simulator import Action, Frame, Simulator


class RecordedAgent:
    """Answers what the records of an episode say that an agent answered."""

    def __init__(self, records: Mapping[int, StageRecord]) -> None:
        """An agent for one episode.

        Args:
            records: Its stages', by number.
        """
        self.sensing = Sensing()
        self._records = records
        self._record: StageRecord | None = None
        self._num_acted = 0

    def begin_task(self, task: TaskInfo) -> None:
        """Nothing to be done."""

    def begin_stage(self, stage: StageInput) -> None:
        """Turns to the stage's record."""
        self._record = self._records[stage.stage]
        self._num_acted = 0
        self.sensing = _sensing_of(self._record)

    def act(self, observation: Observation) -> AgentAction:
        """The recorded action of this round."""
        trace = self._here.trace
        if self._num_acted == len(trace):
            raise InvalidArgumentError(f"the record ends after {len(trace)} rounds, without a stop or the budget's end")
        self._num_acted += 1
        return _action_of(trace[self._num_acted - 1].action)

    @property
    def _here(self) -> StageRecord:
        assert self._record is not None  # the protocol begins with begin_stage
        return self._record


class ExplainingRecordedAgent(RecordedAgent):
    """Says of itself, too, what the records say that the agent said."""

    def diagnostics(self) -> RoundDiagnostics:
        """What the agent said of the round."""
        told = self._here.trace[self._num_acted - 1]
        return RoundDiagnostics(
            choice=told.choice,
            chosen_entry=None if told.chosen_entry is None else _belief_of(told.chosen_entry),
            num_entries=told.num_entries,
            num_frontiers=told.num_frontiers,
            counters=told.counters,
            details=told.details,
        )

    def entries(self) -> Sequence[EntryBelief]:
        """What the agent remembered at the end."""
        return [_belief_of(entry) for entry in self._here.entries]


class _Blind:
    """Perception for one who does not look."""

    needs_rgb = False

    def begin_stage(self, scene: StageScene) -> None:
        """Nothing to prepare."""

    def perceive(self, frames: Sequence[Frame]) -> list[Percept]:
        """Nothing in any of them."""
        return [Percept(_nothing(frame), frame.depth_m, frame.pose) for frame in frames]

    def text_feature(self, text: str) -> None:
        """Has none."""


def _nothing(frame: Frame) -> Detections:
    masks = np.full(frame.depth_m.shape, -1, dtype=np.int32)
    return Detections(masks=masks, labels=(), confidences=np.zeros(0, np.float32))


def reenact(
    case: EpisodeSpec, records: Mapping[int, StageRecord], simulator: Simulator, protocol: ProtocolConfig
) -> Iterator[tuple[int, tuple[str, ...]]]:
    """Carries out the actions of one episode again.

    Args:
        case: The task.
        records: All its stages', by number, of one agent.
        simulator: Of the kind that the run used.
        protocol: The run's.

    Yields:
        A stage, and where its record differs from what came of its actions: nothing, for a true record.
    """
    says_nothing = all(record.memory_at_end is None for record in records.values())
    agent = RecordedAgent(records) if says_nothing else ExplainingRecordedAgent(records)
    for outcome in Episode(case, records[1].agent, agent, simulator, _Blind(), protocol, seed=0).run():
        stage = outcome.record.stage
        yield (
            stage,
            record_differences(_checkable(records[stage]), _checkable(outcome.record), "when carried out again"),
        )


def _checkable(record: StageRecord) -> str:
    """A record without what depends on what its agent held between stages and rounds, which records do not tell."""
    return record.model_copy(
        update={"memory_at_start": None, "num_forgotten": None, "stale_entries": (), "moved_objects": ()}
    ).model_dump_json()


def work(settings: str, _alive: Callable[[], None]) -> Callable[[str], str]:
    """What a worker of `evonav.parallel.pool` does: a job is a task's folder and records, its answer the differences.

    Args:
        settings: `protocol`, `simulator` and `simulator_options`, as JSON.
    """
    told = json.loads(settings)
    backend = Backend(simulator=told["simulator"], simulator_options=told["simulator_options"])
    protocol = ProtocolConfig(**told["protocol"])
    simulator = backend.make_simulator()

    def answer(text: str) -> str:
        job = json.loads(text)
        records = [StageRecord.model_validate_json(record) for record in job["records"]]
        case = backend.load_case(Path(job["path"]))
        found = reenact(case, {record.stage: record for record in records}, simulator, protocol)
        return json.dumps([[stage, list(differences)] for stage, differences in found if differences])

    return answer


def _sensing_of(record: StageRecord) -> Sensing:
    told = record.sensing
    if told is None:
        raise InvalidArgumentError(f"{record.task_id} stage {record.stage}: the record does not tell `sensing`")
    return Sensing(
        first_round=ViewSchedule(*told.first_round),
        later_rounds=ViewSchedule(*told.later_rounds),
        motion=told.motion,
        max_travel_m=told.max_travel_m,
        occupancy_range_m=told.occupancy_range_m,
    )


def _action_of(told: ActionRecord) -> AgentAction:
    if told.kind == "navigate_to" and told.position_m is not None:
        return NavigateTo(told.position_m, told.face_m)
    if told.kind == "move" and told.action is not None:
        return Move(Action(told.action))
    return Stop(told.reason or "")


def _belief_of(entry: EntryRecord) -> EntryBelief:
    return EntryBelief(
        entry_id=entry.entry_id,
        label=entry.label,
        centre_m=entry.centre_m,
        size_m=entry.size_m,
        num_detections=entry.num_detections,
    )
