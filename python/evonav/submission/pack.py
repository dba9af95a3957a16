"""Pack a run into one file: every record, the configuration, the tasks' checksums and the claimed scores.

`evonav.submission.file` defines the file.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from evonav.errors import InvalidArgumentError
from evonav.evaluation.agent_order import agents_in_order
from evonav.evaluation.baselines import BASELINES
from evonav.evaluation.metrics.navigation import agent_pairs, summarise, summary_json
from evonav.evaluation.metrics.stage_metrics import RecordMetrics, metrics_of
from evonav.evaluation.records.schema import EndState, StageRecord
from evonav.evaluation.records.store import RunStore
from evonav.evaluation.run.summary import isolations_of
from evonav.submission.file import About, PackedTask, Submission, write_submission


def pack(run_dir: Path, out: Path, *, agents: Sequence[str] | None = None, about: About | None = None) -> Submission:
    """Write a submission.

    Args:
        out: The file to write, whole or not at all.
        agents: Names of agents of the run; default: all but baselines.
        about: Title, authors and other statements.

    Raises:
        InvalidArgumentError: An agent is not of the run, is a baseline, or has stages without a score.
        StoreError: There is no run, or the file cannot be written.
    """
    with RunStore(run_dir) as store:
        header = _header(store, run_dir, agents, about or About())
        write_submission(out, header, (text for agent in header.agents for text in store.record_texts(agent)))
    return header


def packed_summary(rows: Mapping[str, Sequence[RecordMetrics]], num_stages: int) -> dict[str, Any]:
    """Compute the scores that a submission claims from each agent's stages, of which there should be `num_stages`."""
    summaries = [summarise(agent, mine, num_stages) for agent, mine in rows.items()]
    summary: dict[str, Any] = json.loads(json.dumps(summary_json(summaries, agent_pairs(rows))))
    return summary


def brief(record: StageRecord) -> StageRecord:
    """Return what scores need of a record."""
    large = {"trace": (), "entries": (), "stale_entries": (), "moved_objects": (), "stop_reason": ""}
    return record.model_copy(update=large)


def _header(store: RunStore, run_dir: Path, agents: Sequence[str] | None, about: About) -> Submission:
    there: list[str] = store.meta("agents") or []
    chosen = agents_in_order([agent for agent in there if agent not in BASELINES] if agents is None else agents)
    if not chosen:
        raise InvalidArgumentError(f"{run_dir}: no agent to pack")
    stages: dict[str, int] = store.meta("num_stages") or {}
    num_stages = sum(stages.values())
    rows: dict[str, list[RecordMetrics]] = {}
    for agent in chosen:
        if agent not in there:
            raise InvalidArgumentError(f"{run_dir}: no agent {agent!r}; it has {', '.join(there)}")
        if agent in BASELINES:
            raise InvalidArgumentError(f"{agent} is a baseline and no contestant: leave it out")
        rows[agent] = [metrics_of(brief(record)) for record in store.records(agent)]
        num_scored = sum(row.is_scored or row.state == EndState.GUIDED for row in rows[agent])
        if num_scored != num_stages:
            raise InvalidArgumentError(
                f"{agent} is incomplete: {num_scored} of {num_stages} stages have a score;"
                " run `evonav evaluate --retry-errored` on it"
            )
    config = {**store.meta("config"), "isolation": ", ".join(isolations_of(store)) or None}
    digests = store.meta("task_digests")
    return Submission(
        evonav=str(config["evonav"]),
        about=about,
        config={key: value for key, value in config.items() if key not in ("evonav", "tasks", "num_tasks")},
        tasks=tuple(PackedTask(task_id=name, num_stages=stages[name], digest=digests[name]) for name in sorted(stages)),
        agents=tuple(chosen),
        summary=packed_summary(rows, num_stages),
    )
