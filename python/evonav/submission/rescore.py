"""Score recorded actions again: executed again, they must give the same records, byte for byte.

No agent runs. A stand-in answers with the recorded actions and explanations. The evaluator computes poses,
paths, visibility, staleness, distances, SPL and success again.
"""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from evonav.agents.agent import (
    AgentAction,
    EntryBelief,
    SensorConfig,
)
from evonav.agents.explanation import Explanation
from evonav.component import Component
from evonav.errors import InvalidArgumentError
from evonav.evaluation.episode.episode import Episode
from evonav.evaluation.episode.spec import EpisodeSpec
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.record_diff import record_differences
from evonav.evaluation.records.schema import StageRecord
from evonav.evaluation.run.components import Backend
from evonav.perception import Percept, StageScene
from evonav.sensors.observation import Detections, Observation
from evonav.tasks.public import Goal, TaskInfo
from evonav.world.simulator import Frame, Simulator


class RecordedAgent:
    """Answer with the recorded actions and explanations of an episode."""

    def __init__(self, records: Mapping[int, StageRecord]) -> None:
        """Replay an episode, given its stages by number; an agent that noted no memory explained nothing."""
        explains = any(record.memory_at_end is not None for record in records.values())
        self.explain = self._explanation if explains else None
        self.sensors = SensorConfig()
        self._records = records
        self._record: StageRecord | None = None
        self._num_acted = 0

    def begin_task(self, task: TaskInfo) -> None:
        """Do nothing."""

    def begin_stage(self, goal: Goal) -> None:
        """Turn to the stage's record."""
        self._record = self._records[goal.stage]
        self._num_acted = 0
        if self._record.sensing is None:
            raise InvalidArgumentError(f"{self._record.task_id} stage {goal.stage}: the record has no `sensing`")
        self.sensors = replace(self._record.sensing, needs_rgb=False)  # nobody looks

    def act(self, observation: Observation) -> AgentAction:
        """Return the recorded action of this round."""
        trace = self._here.trace
        if self._num_acted == len(trace):
            raise InvalidArgumentError(f"the record ends after {len(trace)} rounds, without a stop or the budget's end")
        self._num_acted += 1
        return trace[self._num_acted - 1].action

    def _explanation(self) -> Explanation:
        """Return the recorded explanation of the round, with the entries at the stage's end."""
        if self._num_acted == 0:
            return Explanation(objects=self._entries)
        recorded = self._here.trace[self._num_acted - 1]
        return Explanation(
            objects=self._entries,
            choice=recorded.choice,
            chosen_entry=recorded.chosen_entry,
            num_entries=recorded.num_entries,
            num_frontiers=recorded.num_frontiers,
            counters=recorded.counters,
            details=recorded.details,
        )

    def _entries(self) -> Sequence[EntryBelief]:
        return self._here.entries

    @property
    def _here(self) -> StageRecord:
        assert self._record is not None  # the protocol begins with begin_stage
        return self._record


class _NoDetections:
    """A perception that detects nothing."""

    needs_rgb = False

    def begin_stage(self, scene: StageScene) -> None:
        """Do nothing."""

    def change_scene(self, scene: StageScene) -> None:
        """Do nothing."""

    def perceive(self, frames: Sequence[Frame]) -> list[Percept]:
        """Return frames without detections."""
        found = []
        for frame in frames:
            masks = np.full(frame.depth_m.shape, -1, dtype=np.int32)
            nothing = Detections(masks=masks, labels=(), confidences=np.zeros(0, np.float32))
            found.append(Percept(nothing, frame.depth_m, frame.pose))
        return found

    def text_feature(self, text: str) -> None:
        """Return no feature."""


def rescore(
    case: EpisodeSpec, records: Mapping[int, StageRecord], simulator: Simulator, protocol: ProtocolConfig
) -> Iterator[tuple[int, tuple[str, ...]]]:
    """Execute the actions of one episode again, in a simulator of the kind and by the protocol that the run used.

    Yields:
        A stage, and how its record differs from the result of its actions; no differences for a true record.
    """
    agent = RecordedAgent(records)
    for outcome in Episode(case, records[1].agent, agent, simulator, _NoDetections(), protocol, seed=0).run():
        stage = outcome.record.stage
        yield (
            stage,
            record_differences(_checkable(records[stage]), _checkable(outcome.record), "when carried out again"),
        )


def _checkable(record: StageRecord) -> str:
    """Return a record without what is not carried out: the agent's memory between rounds, which is not recorded."""
    left_out = dict.fromkeys(("sensing", "memory_at_start", "belief_at_start", "num_forgotten"))
    return record.model_copy(update={**left_out, "stale_entries": (), "moved_objects": ()}).model_dump_json()


def work(settings: str, _alive: Callable[[], None]) -> Callable[[str], str]:
    """Return the work of a worker: a job holds a task's folder and records, its answer the differences.

    `settings` has `protocol`, `simulator` and `camera` (its options), as JSON.
    """
    values = json.loads(settings)
    simulators: Component[Simulator] = Component(values["simulator"], values["camera"])
    protocol = ProtocolConfig(**values["protocol"])
    simulator = simulators.create()

    def answer(text: str) -> str:
        job = json.loads(text)
        records = [StageRecord.model_validate_json(record) for record in job["records"]]
        case = Backend().tasks.create(Path(job["path"]))
        found = rescore(case, {record.stage: record for record in records}, simulator, protocol)
        return json.dumps([[stage, list(differences)] for stage, differences in found if differences])

    return answer
