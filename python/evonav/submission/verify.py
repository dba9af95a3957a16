"""Verify a submission: it is whole, of the benchmark's protocol and tasks, and its actions give its scores.

No file can show that an agent chose its actions by itself: for that, the agent has to be run again.
"""

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from evonav.evaluation.episode.oracle_baselines import ORACLE_BASELINES
from evonav.evaluation.metrics.scoring import score_stage
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.former_paths import with_current_paths
from evonav.evaluation.records.schema import EndState, StageRecord
from evonav.evaluation.run.components import Backend
from evonav.json_diff import json_differences
from evonav.parallel.pool import Job, answers, open_pool
from evonav.parallel.worker import Workforce
from evonav.submission.pack import PackedRecords, Submission, SubmissionError, SubmissionFile, packed_summary
from evonav.submission.packed_setup import camera_of
from evonav.tasks.bundled import FORMER_IMAGES, former_digest, is_former
from evonav.tasks.listing import TaskFile

MAX_WORDS = 5
"""Findings that one check lists; the others are counted."""
TOLERANCE = 1e-9
"""Allowed difference of a claimed score, since other machines may round sums differently."""
EPISODE_TIMEOUT_S = 1800.0
_OUR_SIMULATORS = ("embedded_simulator", "lenient_simulator")
"""Simulators in which actions can be executed again; no other name is taken from a file."""


@dataclass(frozen=True, slots=True)
class Check:
    """Result of one check."""

    name: str
    is_passed: bool
    detail: str
    """The findings, or how much was checked."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """Result of verifying a file."""

    checks: tuple[Check, ...]
    submission: Submission | None
    """The header; `None` if it is not readable."""
    is_rescored: bool
    """True if the actions were executed again; otherwise scores only agree with the traces."""
    num_required: int = 0
    """Number of tasks that were required, and whose actions were executed again."""

    @property
    def is_accepted(self) -> bool:
        """True if every check passed."""
        return all(check.is_passed for check in self.checks)


def verify(
    path: Path,
    tasks: Sequence[TaskFile],
    *,
    limit: int | None = None,
    scores_only: bool = False,
    num_workers: int = 0,
    on_progress: Callable[[int, int], None] = lambda _done, _all: None,
) -> Verdict:
    """Verify a submission.

    Args:
        path: The file.
        tasks: All tasks that the submission has to contain.
        limit: Require only the first tasks, and execute only their actions again. Default: all.
        scores_only: Compute scores from the recorded paths instead of executing the actions again.
        num_workers: Number of processes; 0 runs in this one.
        on_progress: Called with the number of episodes executed again, and of all.
    """
    checks: list[Check] = []
    try:
        with SubmissionFile(path) as file:
            header = file.header
            records = {part.agent: read_records(file, part) for part in header.records}
    except SubmissionError as error:
        return Verdict((Check("file", False, str(error)),), None, False)
    checks.append(Check("file", True, f"records: {sum(map(len, records.values()))}, agents: {', '.join(records)}"))
    known = {task.task_id: task for task in tasks}
    required = list(known)[:limit]
    checks.append(_check("protocol", _protocol_findings(header), "the benchmark's"))
    checks.append(_check("tasks", _task_findings(header, known, required), _known_tasks(header)))
    checks.append(_check("complete", _gaps(header, records), "every stage once, and scored"))
    if all(check.is_passed for check in checks):
        scored = (finding for mine in records.values() for record in mine for finding in score_findings(record, header))
        checks.append(_check("paths", scored, "lengths, distances, success and SPL follow from the recorded paths"))
        checks.append(_check("scores", _claims(header, records), "the claimed summary is that of the records"))
        if not scores_only:
            chosen = {agent: [r for r in mine if r.task_id in set(required)] for agent, mine in records.items()}
            found = _rescore(header, chosen, known, num_workers, on_progress)
            checks.append(_check("actions", found, "replayed, they give the same records, byte for byte"))
    return Verdict(tuple(checks), header, checks[-1].name == "actions", len(required))


def verdict_json(verdict: Verdict) -> dict[str, Any]:
    """Return a verdict as JSON values."""
    header = verdict.submission
    return {
        "is_accepted": verdict.is_accepted,
        "is_rescored": verdict.is_rescored,
        "checks": [asdict(check) for check in verdict.checks],
        "about": None if header is None else header.about.model_dump(),
        "summary": None if header is None else header.summary,
    }


def score_findings(record: StageRecord, header: Submission) -> Iterator[str]:
    """Yield the contradictions between a scored record and its own path.

    The formulas are those of the protocol (paper, Sec. C.2), from rounds, target and reference length.
    """
    if record.state is EndState.GUIDED:
        return  # a guided stage has no score
    where = f"{record.agent} {record.task_id} stage {record.stage}"
    start, end, trace = record.effective_start, record.terminal, record.trace
    if start is None or end is None or record.reference_length_m is None or record.path_length_m is None or not trace:
        yield f"{where}: a scored stage without start, end, rounds or lengths"
        return
    points = [(start.x_m, start.z_m), *(point for entry in trace for point in entry.path_m), (end.x_m, end.z_m)]
    if any(
        before.path_m[-1] != after.path_m[0] or (after.pose.x_m, after.pose.z_m) != after.path_m[0]
        for before, after in pairwise(trace)
    ):
        yield f"{where}: the path jumps between rounds"
    if points[0] != points[1] or points[-1] != points[-2]:
        yield f"{where}: the path does not lead from start to end"
    length_m = sum(math.fsum(math.dist(a, b) for a, b in pairwise(entry.path_m)) for entry in trace)
    target = (record.target.position_m[0], record.target.position_m[2])
    score = score_stage(
        points[0],
        points[-1],
        target,
        path_length_m=length_m,
        reference_length_m=record.reference_length_m,
        success_radius_m=header.config["protocol"]["success_radius_m"],
    )
    made: dict[str, object] = {
        "num_rounds": len(trace),
        "num_target_visible_rounds": sum(entry.is_target_visible for entry in trace),
        "has_stopped": trace[-1].action.kind == "stop",
        "state": EndState.SUCCESS if score.is_success else EndState.FAILURE,
        "path_length_m": length_m,
        "start_distance_m": score.start_distance_m,
        "terminal_distance_m": score.terminal_distance_m,
        "spl": score.spl,
        "soft_spl": score.soft_spl,
    }
    for field, value in made.items():
        claimed = getattr(record, field)
        is_close = isinstance(value, float) and claimed is not None and math.isclose(claimed, value, abs_tol=TOLERANCE)
        if not is_close and claimed != value:
            yield f"{where}: {field} is {claimed}, its path gives {value}"


def read_records(file: SubmissionFile, part: PackedRecords) -> list[StageRecord]:
    """Return the records of one agent.

    Raises:
        SubmissionError: The member is not what the header says, or a line is not a record as evonav writes it.
    """
    records = []
    for number, text in enumerate(file.texts(part), start=1):
        try:
            record = StageRecord.model_validate_json(text)
        except ValidationError as error:
            first = error.errors()[0]
            field = ".".join(str(step) for step in first["loc"])
            raise SubmissionError(f"{file.path}: {part.member}, line {number}: {field}: {first['msg']}") from error
        if record.model_dump_json() != text:
            raise SubmissionError(f"{file.path}: {part.member}, line {number}: not as evonav writes records")
        records.append(record)
    return records


def _protocol_findings(header: Submission) -> Iterator[str]:
    claimed = header.config.get("protocol")
    if not isinstance(claimed, dict):
        yield "the header has no protocol"
        return
    # Packs of earlier versions have other reference paths, and no entry for them.
    is_earlier = "reference_in_room" not in claimed
    expected = ProtocolConfig(reference_in_room=not is_earlier).header()
    for name in expected.keys() | claimed.keys():
        if claimed.get(name) != expected.get(name):
            yield f"{name} is {claimed.get(name)}, the benchmark's is {expected.get(name)}"


def _task_findings(header: Submission, known: Mapping[str, TaskFile], required: Sequence[str]) -> Iterator[str]:
    if not header.tasks:
        yield "there is none"
    for task in header.tasks:
        there = known.get(task.task_id)
        if there is None:
            yield f"{task.task_id} is not among the tasks to verify with"
        elif there.num_stages != task.num_stages or task.digest not in (there.digest, former_digest(there)):
            yield f"{task.task_id} is another task than the one of this name"
    packed = {task.task_id for task in header.tasks}
    missing = set(required) - packed
    if missing and packed == set(required[: len(packed)]):
        yield f"only the first {len(packed)} of {len(required)} are there: --limit {len(packed)} verifies those"
        return
    for name in sorted(missing):
        yield f"{name} is missing"


def _known_tasks(header: Submission) -> str:
    num_former = sum(is_former(task.task_id, task.digest) for task in header.tasks)
    return f"{len(header.tasks)}, all known" + (f"; {num_former} with {FORMER_IMAGES}" if num_former else "")


def _gaps(header: Submission, records: Mapping[str, Sequence[StageRecord]]) -> Iterator[str]:
    if len(records) != len(header.records) or not records:
        yield "an agent is there twice, or none is"
    expected = sorted((task.task_id, stage) for task in header.tasks for stage in range(1, task.num_stages + 1))
    for part in header.records:
        mine = records[part.agent]
        if part.agent in ORACLE_BASELINES:
            yield f"{part.agent} is an oracle baseline: it knows what agents do not"
        if [(record.task_id, record.stage) for record in mine] != expected:
            yield f"{part.agent}: not every stage of every task, once and in order"
        for record in mine:
            if record.agent != part.agent:
                yield f"{part.agent}: a record of {record.agent}"
            # Whether the task has this guided stage shows when the actions are executed again.
            if not record.is_scored and record.state is not EndState.GUIDED:
                yield f"{part.agent} {record.task_id} stage {record.stage} is {record.state.value}"


def _claims(header: Submission, records: Mapping[str, Sequence[StageRecord]]) -> Iterator[str]:
    num_stages = sum(task.num_stages for task in header.tasks)
    claimed, computed = header.summary, packed_summary({a: list(r) for a, r in records.items()}, num_stages)
    if claimed.get("schema_version") == 1:
        claimed, computed = _without_intervals(claimed), _without_intervals(computed)
    for one in json_differences(claimed, computed, is_equal=_is_close):
        yield f"{one.path} is {one.left}, the records give {one.right}"


def _without_intervals(summary: Any) -> Any:  # noqa: ANN401 - JSON
    """Leave out what version 1 of a summary did not have, or took over tasks instead of houses."""
    if isinstance(summary, list):
        return [_without_intervals(each) for each in summary]
    if not isinstance(summary, dict):
        return summary
    return {
        key: _without_intervals(value)
        for key, value in summary.items()
        if key not in ("schema_version", "num_houses") and not key.endswith(("_ci95", "_p", "_verdict"))
    }


def _is_close(claimed: Any, computed: Any) -> bool:  # noqa: ANN401 - JSON
    if isinstance(claimed, float) and isinstance(computed, float):
        return math.isclose(claimed, computed, abs_tol=TOLERANCE)
    return bool(claimed == computed) and type(claimed) is type(computed)


def _rescore(
    header: Submission,
    records: Mapping[str, Sequence[StageRecord]],
    known: Mapping[str, TaskFile],
    num_workers: int,
    on_progress: Callable[[int, int], None],
) -> Iterator[str]:
    backend = with_current_paths(header.config.get("backend"))
    simulator = str(backend.get("simulator")) if isinstance(backend, dict) else ""
    module, _, name = simulator.partition(":")
    if module != Backend.__module__ or name not in _OUR_SIMULATORS:
        yield f"simulator {simulator!r}: actions can be replayed only in evonav's own simulator (see --scores-only)"
        return
    settings = {"protocol": header.config["protocol"], "simulator": simulator, "camera": camera_of(backend)}
    episodes: dict[tuple[str, str], list[StageRecord]] = {}
    for agent, mine in records.items():
        for record in mine:
            episodes.setdefault((agent, record.task_id), []).append(record)
    names = list(episodes)
    work = "evonav.submission.rescore:work"
    with open_pool(work, json.dumps(settings), Workforce(num_workers), timeout_s=EPISODE_TIMEOUT_S) as pool:
        jobs = (
            Job(number, _episode_text(known[task_id].path, mine))
            for number, ((_, task_id), mine) in enumerate(episodes.items())
        )
        for num_done, answer in enumerate(answers(pool, jobs), start=1):
            on_progress(num_done, len(names))
            agent, task_id = names[answer.key]
            if answer.failure is not None:
                yield f"{agent} {task_id}: {answer.detail.strip().splitlines()[-1]}"
                continue
            for stage, differences in json.loads(answer.text):
                yield f"{agent} {task_id} stage {stage}: {'; '.join(differences)}"


def _episode_text(path: Path, records: Sequence[StageRecord]) -> str:
    return json.dumps({"path": str(path), "records": [record.model_dump_json() for record in records]})


def _check(name: str, findings: Iterator[str], if_none: str) -> Check:
    found = list(findings)
    if not found:
        return Check(name, True, if_none)
    more = f"; and {len(found) - MAX_WORDS} more" if len(found) > MAX_WORDS else ""
    return Check(name, False, "; ".join(found[:MAX_WORDS]) + more)
