"""Read a run for reports: the metrics of all agents at once, records with their traces one task at a time."""

import hashlib
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from evonav.errors import StoreError
from evonav.evaluation.agent_order import agents_in_order
from evonav.evaluation.metrics.navigation import AgentPair, AgentSummary, agent_pairs, summarise
from evonav.evaluation.metrics.stage_metrics import StageMetrics
from evonav.evaluation.metrics.stage_rows import read_stage_metrics
from evonav.evaluation.records.floor_plans import FloorPlan
from evonav.evaluation.records.schema import BeliefRecord, EndState, StageError, StageRecord
from evonav.evaluation.records.store import FailureRow, RunStore
from evonav.points import Point3
from evonav.report.maps.stage_map import success_radius_of
from evonav.report.tables.causes import FailureCause
from evonav.report.tables.table import short_names

NOTES = ("tasks_dir", "task_digests", "sessions")
"""Entries of a run's header that do not change its records: the folder and digests of its tasks, and its commands."""


@dataclass(frozen=True, slots=True)
class RecordedStage:
    """A recorded stage: its row, and what else of its record tables and overviews show."""

    row: StageMetrics
    category: str
    """The goal's."""
    error: StageError | None
    target_m: Point3
    first_target_m: Point3 | None
    """The target's place in stage 1, if it ever moved."""
    is_change_around_target: bool
    """True if the target is in the room that changed before the stage."""
    belief: BeliefRecord | None

    @staticmethod
    def of(row: StageMetrics, record: StageRecord) -> "RecordedStage":
        """Return a stage from its row and its record, which may lack its trace and entries."""
        target = record.target
        return RecordedStage(
            row=row,
            category=record.goal.category,
            error=record.error,
            target_m=target.position_m,
            first_target_m=target.first_position_m,
            is_change_around_target=record.transition.room_id == target.room_id,
            belief=record.belief_at_start,
        )

    @property
    def cause(self) -> FailureCause | None:
        """The reason why it is no success."""
        return None if self.row.cause is None else FailureCause(self.row.cause)


@dataclass(frozen=True, slots=True)
class RecordedTask:
    """The records of all agents in one task."""

    task_id: str
    num_stages: int
    records: Mapping[tuple[str, int], StageRecord]
    """Records by (agent, stage); a missing stage was not run yet."""
    maps: Mapping[int, FloorPlan]


@dataclass(frozen=True)
class RecordedRun:
    """A run's header and recorded stages; what is computed from them is computed on first use."""

    run_dir: Path
    agents: tuple[str, ...]
    num_stages: Mapping[str, int]
    """Number of stages by task id, in order."""
    config: Mapping[str, Any]
    outcomes: Mapping[tuple[str, str, int], RecordedStage]
    """Recorded stages by (agent, task, stage)."""
    notes: Mapping[str, Any]
    """The entries of the run's header that `NOTES` names, where present."""
    failures: tuple[FailureRow, ...]
    """Failed attempts, including those that were retried; not part of the records."""

    @cached_property
    def names(self) -> dict[str, str]:
        """The short names of agents that people read, by agent; see `short_names`."""
        return {agent: agent for agent in self.agents} | short_names(self.agents)

    @property
    def success_radius_m(self) -> float:
        """The run's success radius."""
        return success_radius_of(self.config)

    @property
    def num_recorded(self) -> int:
        """Stages with a record, over all agents."""
        return len(self.outcomes)

    @property
    def num_expected(self) -> int:
        """Stages that the run consists of, over all agents."""
        return sum(self.num_stages.values()) * len(self.agents)

    @cached_property
    def summaries(self) -> tuple[AgentSummary, ...]:
        """One summary per agent.

        Raises:
            StoreError: An agent has more records than the run has stages.
        """
        total = sum(self.num_stages.values())
        return tuple(summarise(agent, rows, total) for agent, rows in self.rows_by_agent().items())

    @cached_property
    def pairs(self) -> tuple[AgentPair, ...]:
        """Every two agents on the stages that both scored."""
        return tuple(agent_pairs(self.rows_by_agent()))

    @property
    def wall_s(self) -> dict[str, list[float]]:
        """Wall times of the stages that were begun, by agent; not part of the records."""
        found: dict[str, list[float]] = {}
        for (agent, _, _), one in self.outcomes.items():
            if one.row.wall_s:
                found.setdefault(agent, []).append(one.row.wall_s)
        return found

    @cached_property
    def rows_sha256(self) -> dict[str, str]:
        """Digest of each agent's records as stored; equal runs have equal digests."""
        found = {agent: hashlib.sha256() for agent in self.agents}
        for agent, _, text in self._texts():
            found[agent].update(text.encode() + b"\n")
        return {agent: digest.hexdigest() for agent, digest in found.items()}

    @cached_property
    def episodes_sha256(self) -> dict[tuple[str, str], str]:
        """Digest of the records of each (agent, task), which tells whether an episode's page shows these records."""
        found: dict[tuple[str, str], Any] = {}
        for agent, task_id, text in self._texts():
            found.setdefault((agent, task_id), hashlib.sha256()).update(text.encode())
        return {key: digest.hexdigest() for key, digest in found.items()}

    def _texts(self) -> Iterator[tuple[str, str, str]]:
        """Yield agent, task and text of every record."""
        with RunStore(self.run_dir) as store, store.snapshot():
            for (agent, task_id, _), text in zip(sorted(store.states()), store.record_texts(), strict=True):
                yield agent, task_id, text

    def rows_by_agent(self) -> dict[str, list[StageMetrics]]:
        """Return the rows of each agent."""
        found: dict[str, list[StageMetrics]] = {agent: [] for agent in self.agents}
        for (agent, _, _), outcome in self.outcomes.items():
            found[agent].append(outcome.row)
        return found

    def scored(self, agent: str) -> list[RecordedStage]:
        """Return an agent's stages that count in rates."""
        return [outcome for key, outcome in self.outcomes.items() if key[0] == agent and outcome.row.is_scored]

    def cause_counts(self) -> dict[str, Counter[FailureCause | None]]:
        """Count stages by cause, for each agent."""
        counts: dict[str, Counter[FailureCause | None]] = {agent: Counter() for agent in self.agents}
        for (agent, _, _), outcome in self.outcomes.items():
            counts[agent][outcome.cause] += 1
        return counts

    def tasks(self) -> Iterator[RecordedTask]:
        """Yield every task with whole records and maps, one at a time: a run's traces may not fit in memory."""
        with RunStore(self.run_dir) as store:
            for task_id, num_stages in self.num_stages.items():
                records = {
                    (agent, record.stage): record for agent in self.agents for record in store.records(agent, task_id)
                }
                maps = {floor_plan.stage: floor_plan for floor_plan in store.floor_plans(task_id)}
                yield RecordedTask(task_id, num_stages, records, maps)


def load_run(run_dir: Path) -> RecordedRun:
    """Read a run, finished or not.

    Raises:
        StoreError: There is no run, it cannot be read, or a row is not the record of its stage.
    """
    with RunStore(run_dir) as store, store.snapshot():
        outcomes: dict[tuple[str, str, int], RecordedStage] = {}
        states = store.states()
        planned = store.meta("num_stages")
        agents = agents_in_order([*(store.meta("agents") or ()), *(agent for agent, _, _ in states)])
        rows = {(row.agent, row.task_id, row.stage): row for row in read_stage_metrics(store)}
        for agent in agents:
            keys = sorted(key for key in states if key[0] == agent)
            for key, record in zip(keys, store.records(agent, is_brief=True), strict=True):
                _check(run_dir, key, states[key], record, planned)
                outcomes[key] = RecordedStage.of(rows[key], record)
        # Tasks that the header does not name have as many stages as their records say.
        num_stages = {one.row.task_id: one.row.num_stages for one in outcomes.values()} | (planned or {})
        return RecordedRun(
            run_dir=run_dir,
            agents=agents,
            num_stages=dict(sorted(num_stages.items())),
            config=store.meta("config") or {},
            outcomes=outcomes,
            notes={key: value for key in NOTES if (value := store.meta(key)) is not None},
            failures=tuple(store.failures()),
        )


def _check(
    run_dir: Path,
    key: tuple[str, str, int],
    state: EndState,
    record: StageRecord,
    num_stages: Mapping[str, int] | None,
) -> None:
    """Reject a row that holds the record of another stage, or of a stage that the run does not have."""
    (agent, task_id, stage), found = key, (record.agent, record.task_id, record.stage)
    if found != key or record.state is not state:
        what = f"{found[0]}, {found[1]}, stage {found[2]}, {record.state.value}"
        raise StoreError(
            f"{run_dir}: the row of {agent}, {task_id}, stage {stage}, {state.value} holds the record of {what}"
        )
    if num_stages and not 1 <= stage <= num_stages.get(task_id, 0):
        raise StoreError(f"{run_dir}: stage {stage} of {task_id} by {agent} is no stage of this run")
