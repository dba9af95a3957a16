"""A run as a report needs it: measures of all agents held at once, stages with their traces a task at a time."""

import hashlib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from evonav.errors import StoreError
from evonav.evaluation.metrics.navigation import AgentPair, AgentSummary, agent_pairs, summarise
from evonav.evaluation.metrics.stage_metrics import StageMetrics, read_stage_metrics
from evonav.evaluation.records.schema import EndState, FloorPlan, StageRecord
from evonav.evaluation.records.store import FailureRow, RunStore
from evonav.report.maps.stage_map import success_radius_of
from evonav.report.tables.causes import FailureCause

PAPER_ORDER = ("unigoal", "3d-mem", "msgnav", "fu", "stage-reset", "ftu")
"""Agents in the order of the paper's tables."""
NOTES = ("tasks_dir", "task_digests", "sessions")
"""Of a run's header, no part of what the run is: where its tasks were and their digests, and how it was called."""


@dataclass(frozen=True, slots=True)
class StageOutcome:
    """A stage in a line: what an overview needs of it."""

    record: StageRecord
    """The record without its trace and entries."""
    cause: FailureCause | None
    num_stale_entries: int
    """Stale entries in memory at the end."""
    stale_path_m: float
    """Walked in rounds that had chosen a stale entry."""
    num_failed_decisions: int = 0
    """Questions that the agent's model did not answer, in spite of all tries: the agent did what it does then."""


@dataclass(frozen=True, slots=True)
class Task:
    """A task with all that its agents did in it."""

    task_id: str
    num_stages: int
    records: Mapping[tuple[str, int], StageRecord]
    """Records by (agent, stage); a missing stage was not run yet."""
    maps: Mapping[int, FloorPlan]


@dataclass(frozen=True, slots=True)
class Run:
    """A run's header and measures."""

    run_dir: Path
    agents: tuple[str, ...]
    num_stages: Mapping[str, int]
    """Number of stages by task id, in order."""
    config: Mapping[str, Any]
    outcomes: Mapping[tuple[str, str, int], StageOutcome]
    """Outcomes by (agent, task, stage)."""
    rows_sha256: Mapping[str, str]
    """Digest of each agent's records as stored; equal runs have equal digests."""
    episodes_sha256: Mapping[tuple[str, str], str]
    """Digest of the records of each (agent, task), to tell whether an episode's page shows these records."""
    notes: Mapping[str, Any]
    """The entries of the run's header that `NOTES` names, where present."""
    total_wall_s: float
    """Sum over all stages."""
    wall_s: Mapping[str, float]
    """Mean of a stage's wall time, by agent; not part of the records."""
    failures: tuple[FailureRow, ...]
    """Attempts that failed, those that were tried again among them; not part of the records."""
    summaries: tuple[AgentSummary, ...]
    pairs: tuple[AgentPair, ...]

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

    def records_by_agent(self) -> dict[str, list[StageRecord]]:
        """Slim records, without traces."""
        found: dict[str, list[StageRecord]] = {agent: [] for agent in self.agents}
        for (agent, _, _), outcome in self.outcomes.items():
            found[agent].append(outcome.record)
        return found

    def scored(self, agent: str) -> list[StageOutcome]:
        """Return an agent's stages that count in rates."""
        return [outcome for key, outcome in self.outcomes.items() if key[0] == agent and outcome.record.is_scored]

    def cause_counts(self) -> dict[str, Counter[FailureCause | None]]:
        """Stages by cause, for each agent."""
        counts: dict[str, Counter[FailureCause | None]] = {agent: Counter() for agent in self.agents}
        for (agent, _, _), outcome in self.outcomes.items():
            counts[agent][outcome.cause] += 1
        return counts

    def tasks(self) -> Iterator[Task]:
        """Every task with whole records and maps, one at a time: a run's traces may not fit in memory.

        Raises:
            StoreError: The run cannot be read.
        """
        with RunStore(self.run_dir) as store:
            for task_id, num_stages in self.num_stages.items():
                records = {
                    (agent, record.stage): record for agent in self.agents for record in store.records(agent, task_id)
                }
                maps = {stage_map.stage: stage_map for stage_map in store.maps(task_id)}
                yield Task(task_id, num_stages, records, maps)


def load_run(run_dir: Path) -> Run:
    """Read a run, finished or not.

    Raises:
        StoreError: There is no run, it cannot be read, or its rows are not those of its stages, each once: no rate of
            such a run would mean anything.
    """
    with RunStore(run_dir) as store, store.snapshot():
        outcomes: dict[tuple[str, str, int], StageOutcome] = {}
        states = store.states()
        asked_stages = store.meta("num_stages")
        agents = agents_in_order(store.meta("agents"), [agent for agent, _, _ in states])
        digests = {}
        episodes: dict[tuple[str, str], Any] = {}
        rows = {(row.agent, row.task_id, row.stage): row for row in read_stage_metrics(store)}
        for agent in agents:
            digest = hashlib.sha256()
            keys = sorted(key for key in states if key[0] == agent)
            brief = list(store.records(agent, is_brief=True))
            for key, text, record in zip(keys, store.record_texts(agent), brief, strict=True):
                digest.update(text.encode())
                digest.update(b"\n")
                _check(run_dir, key, states[key], record, asked_stages)
                outcomes[key] = _outcome(record, rows[key])
                episodes.setdefault((agent, record.task_id), hashlib.sha256()).update(text.encode())
            digests[agent] = digest.hexdigest()
        num_stages = _num_stages(asked_stages, outcomes)
        config = store.meta("config") or {}
        notes = {key: value for key in NOTES if (value := store.meta(key)) is not None}
        timings = store.timings()
        failures = tuple(store.failures())
    records: dict[str, list[StageRecord]] = {agent: [] for agent in agents}
    for (agent, _, _), outcome in outcomes.items():
        records[agent].append(outcome.record)
    total = sum(num_stages.values())
    return Run(
        run_dir=run_dir,
        agents=agents,
        num_stages=num_stages,
        config=config,
        outcomes=outcomes,
        rows_sha256=digests,
        failures=failures,
        episodes_sha256={key: episode.hexdigest() for key, episode in episodes.items()},
        notes=notes,
        total_wall_s=sum(wall_s for wall_s, _ in timings.values()),
        wall_s=_mean_wall_s(timings),
        summaries=tuple(summarise(agent, records[agent], total) for agent in agents),
        pairs=tuple(agent_pairs(records)),
    )


def _check(
    run_dir: Path,
    key: tuple[str, str, int],
    state: EndState,
    record: StageRecord,
    num_stages: Mapping[str, int] | None,
) -> None:
    """Refuses a row that is not the one of its stage, or of no stage of the run."""
    (agent, task_id, stage), held = key, (record.agent, record.task_id, record.stage)
    if held != key or record.state is not state:
        what = f"{held[0]}, {held[1]}, stage {held[2]}, {record.state.value}"
        raise StoreError(
            f"{run_dir}: the row of {agent}, {task_id}, stage {stage}, {state.value} holds the record of {what}"
        )
    if num_stages and not 1 <= stage <= num_stages.get(task_id, 0):
        raise StoreError(f"{run_dir}: stage {stage} of {task_id} by {agent} is no stage of this run")


def _outcome(record: StageRecord, row: StageMetrics) -> StageOutcome:
    return StageOutcome(
        record=record,
        cause=None if row.cause is None else FailureCause(row.cause),
        num_stale_entries=row.num_stale_entries or 0,
        stale_path_m=row.stale_path_m,
        num_failed_decisions=row.num_failed_decisions or 0,
    )


def agents_in_order(asked: Sequence[str] | None, recorded: Sequence[str]) -> tuple[str, ...]:
    """Return the agents of a run: the paper's in the order of its tables, then the others by name."""
    rank = {agent: i for i, agent in enumerate(PAPER_ORDER)}
    return tuple(sorted({*(asked or ()), *recorded}, key=lambda agent: (rank.get(agent, len(rank)), agent)))


def _mean_wall_s(timings: Mapping[tuple[str, str, int], tuple[float, float]]) -> dict[str, float]:
    """Mean over the stages that ran: one that was never begun has taken no time."""
    found: dict[str, list[float]] = {}
    for (agent, _, _), (wall_s, _) in timings.items():
        if wall_s > 0.0:
            found.setdefault(agent, []).append(wall_s)
    return {agent: sum(times) / len(times) for agent, times in found.items()}


def _num_stages(
    asked: Mapping[str, int] | None, outcomes: Mapping[tuple[str, str, int], StageOutcome]
) -> dict[str, int]:
    """Stages of each task, from the run's header; of tasks not named there, from their records."""
    found = {outcome.record.task_id: outcome.record.num_stages for outcome in outcomes.values()}
    return dict(sorted({**found, **(asked or {})}.items()))
