"""Pack a run into one file: a zip of every record, the configuration, the tasks' checksums and the claimed scores.

The same run gives the same bytes. `evonav.submission.file` reads such a file.
"""

import hashlib
import json
import zipfile
from collections.abc import Sequence
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from evonav.errors import InvalidArgumentError, StoreError
from evonav.evaluation.agent_order import agents_in_order
from evonav.evaluation.baselines import BASELINES
from evonav.evaluation.metrics.navigation import agent_pairs, summarise, summary_json
from evonav.evaluation.records.schema import EndState, StageRecord
from evonav.evaluation.records.store import RunStore
from evonav.evaluation.run.provenance import KEY as SESSIONS_KEY
from evonav.evaluation.run.provenance import isolations_of
from evonav.parallel.folders import replacing
from evonav.submission.file import EPOCH, HEADER_NAME, About, PackedRecords, PackedTask, Submission, member_name

_Time = tuple[int, int, int, int, int, int]


def pack(
    run_dir: Path,
    out: Path,
    *,
    agents: Sequence[str] | None = None,
    about: About | None = None,
) -> Submission:
    """Write a submission.

    Args:
        out: The file to write, whole or not at all.
        agents: Names of agents of the run; default: all but baselines.
        about: Title, authors and other statements.

    Raises:
        InvalidArgumentError: An agent is not of the run, is a baseline, or has stages without a score.
        StoreError: There is no run, it was made by an earlier version, or the file cannot be written.
    """
    with RunStore(run_dir) as store:
        header, texts = _read_run(store, run_dir, agents)
        began = _began(store)
    header = header.model_copy(update={"about": about or About()})
    with replacing(out) as beside, zipfile.ZipFile(beside, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        _write(archive, HEADER_NAME, (header.model_dump_json(indent=2) + "\n").encode(), began)
        for part in header.records:
            _write(archive, part.member, texts[part.agent], began)
    return header


def packed_summary(records: dict[str, list[StageRecord]], num_stages: int) -> dict[str, Any]:
    """Compute the scores that a submission claims from each agent's records, of which there should be `num_stages`."""
    summaries = [summarise(agent, mine, num_stages) for agent, mine in records.items()]
    summary: dict[str, Any] = json.loads(json.dumps(summary_json(summaries, agent_pairs(records))))
    return summary


def _read_run(store: RunStore, run_dir: Path, agents: Sequence[str] | None) -> tuple[Submission, dict[str, bytes]]:
    there: list[str] = store.meta("agents") or []
    chosen = agents_in_order([agent for agent in there if agent not in BASELINES] if agents is None else agents)
    digests: dict[str, str] | None = store.meta("task_digests")
    stages: dict[str, int] = store.meta("num_stages") or {}
    if not chosen:
        raise InvalidArgumentError(f"{run_dir}: no agent to pack")
    if digests is None:
        raise StoreError(f"{run_dir}: no checksums of tasks; run `evonav evaluate` on it again, which adds them")
    num_stages = sum(stages.values())
    records: dict[str, list[StageRecord]] = {}
    texts: dict[str, bytes] = {}
    for agent in chosen:
        if agent not in there:
            raise InvalidArgumentError(f"{run_dir}: no agent {agent!r}; it has {', '.join(there)}")
        if agent in BASELINES:
            raise InvalidArgumentError(f"{agent} is a baseline and no contestant: leave it out")
        mine = list(store.records(agent))
        num_scored = sum(record.is_scored or record.state is EndState.GUIDED for record in mine)
        if num_scored != num_stages:
            raise InvalidArgumentError(
                f"{agent} is incomplete: {num_scored} of {num_stages} stages have a score;"
                " run `evonav evaluate --retry-errored` on it"
            )
        records[agent] = [record.model_copy(update={"trace": (), "entries": ()}) for record in mine]
        texts[agent] = "".join(f"{text}\n" for text in store.record_texts(agent)).encode()
    config = {**store.meta("config"), "isolation": ", ".join(isolations_of(store)) or None}
    header = Submission(
        evonav=str(config["evonav"]),
        about=About(),
        config={key: value for key, value in config.items() if key not in ("evonav", "tasks", "num_tasks")},
        tasks=tuple(PackedTask(task_id=name, num_stages=stages[name], digest=digests[name]) for name in sorted(stages)),
        records=tuple(
            PackedRecords(
                agent=agent,
                member=member_name(number),
                num_bytes=len(texts[agent]),
                sha256=hashlib.sha256(texts[agent]).hexdigest(),
            )
            for number, agent in enumerate(chosen, start=1)
        ),
        summary=packed_summary(records, num_stages),
    )
    return header, texts


def _began(store: RunStore) -> _Time:
    """Return when the run began, in UTC: the time stamp of every member, so that equal runs give equal bytes."""
    sessions = store.meta(SESSIONS_KEY) or [{}]
    try:
        return datetime.fromisoformat(sessions[0]["began"]).astimezone(timezone.utc).timetuple()[:6]
    except (KeyError, ValueError):
        return (*EPOCH, 0, 0, 0)


def _write(archive: zipfile.ZipFile, name: str, data: bytes, time: _Time) -> None:
    info = zipfile.ZipInfo(name, time)
    info.compress_type = zipfile.ZIP_DEFLATED
    info.external_attr = 0o644 << 16
    archive.writestr(info, data)
