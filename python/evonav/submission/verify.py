"""Verify a submission: it is whole, of the benchmark's protocol and tasks, and its actions give its scores.

No file can show that an agent chose its actions by itself: for that, the agent has to be run again.
"""

import hashlib
import json
import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from itertools import groupby
from pathlib import Path
from typing import Any

from evonav.errors import EvonavError, InvalidArgumentError
from evonav.evaluation.baselines import ORACLE_BASELINE_NAMES
from evonav.evaluation.episode.spec import EpisodeSpec
from evonav.evaluation.metrics.stage_metrics import RecordMetrics, metrics_of
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.schema import EndState, StageRecord
from evonav.evaluation.run.components import Backend
from evonav.json_diff import json_differences
from evonav.parallel.pool import Job, answers, open_pool
from evonav.parallel.worker import Workforce
from evonav.submission.contradictions import TOLERANCE, change_findings, path_findings, target_findings
from evonav.submission.file import Submission, SubmissionError, read_header, read_records
from evonav.submission.pack import brief, packed_summary
from evonav.submission.packed_setup import camera_of
from evonav.tasks.listing import TaskFile

MAX_WORDS = 5
"""Findings that one check lists; the others are counted."""
MAX_FINDING = 300
"""Longest finding, in characters."""
EPISODE_TIMEOUT_S = 1800.0
_OUR_SIMULATORS = ("embedded_simulator", "lenient_simulator")
"""Simulators in which actions can be executed again; no other name is taken from a file."""


@dataclass(frozen=True, slots=True)
class PackCheck:
    """Result of one check."""

    name: str
    is_passed: bool
    detail: str
    """The findings, or how much was checked."""


@dataclass(frozen=True, slots=True)
class PackVerdict:
    """Result of verifying a file."""

    checks: tuple[PackCheck, ...]
    submission: Submission | None
    """The header; `None` if it is not readable."""
    is_rescored: bool
    """True if the actions were executed again; otherwise scores only agree with the traces."""
    summary: Mapping[str, Any] | None = None
    """The scores of the required tasks, computed from the records; `None` if they were not read to their end."""
    digests: Mapping[str, str] = field(default_factory=dict)
    """SHA-256 of the records of each agent that were read."""

    @property
    def is_accepted(self) -> bool:
        """True if every check passed."""
        return all(check.is_passed for check in self.checks)


@dataclass(slots=True)
class _Findings:
    """Counts what contradicts a check, and keeps the first findings."""

    shown: list[str] = field(default_factory=list)
    num: int = 0

    def add(self, findings: Iterable[str], where: str = "") -> None:
        """Add findings, and name where they are."""
        for finding in findings:
            self.num += 1
            if len(self.shown) < MAX_WORDS:
                self.shown.append(_shown(f"{where}: {finding}" if where else finding))

    def check(self, name: str, if_none: str) -> PackCheck:
        """Return the check that is passed without findings."""
        more = f"; and {self.num - MAX_WORDS} more" if self.num > MAX_WORDS else ""
        return PackCheck(name, self.num == 0, "; ".join(self.shown) + more if self.num else if_none)


class _Records:
    """The records of a file, read one after the other; what scores need of them is kept."""

    def __init__(self, path: Path, header: Submission, known: Mapping[str, TaskFile]) -> None:
        """Read the records of a file whose tasks are all known."""
        self.rows: dict[str, list[RecordMetrics]] = {agent: [] for agent in header.agents}
        """Metrics of the records without their rounds and memory, by agent."""
        self.complete, self.targets, self.paths = _Findings(), _Findings(), _Findings()
        self._known = known
        self._protocol = ProtocolConfig(**header.config["protocol"])
        self._spec: EpisodeSpec | None = None
        self._before: StageRecord | None = None
        self._sha256s = {agent: hashlib.sha256() for agent in header.agents}
        self.complete.add(_agent_findings(header.agents))
        self._read(path, header)

    @property
    def digests(self) -> dict[str, str]:
        """SHA-256 of each agent's records."""
        return {agent: found.hexdigest() for agent, found in self._sha256s.items()}

    def _read(self, path: Path, header: Submission) -> None:
        stages = [(task.task_id, stage) for task in header.tasks for stage in range(1, task.num_stages + 1)]
        expected = [(agent, *stage) for agent in header.agents for stage in stages]
        num_read, records = 0, read_records(path)
        for wanted, (record, line) in zip(expected, records, strict=False):  # in this order: none is taken and lost
            found = (record.agent, record.task_id, record.stage)
            if found != wanted:
                stage = f"{_stage_name(*found)} instead of {_stage_name(*wanted)}"
                self.complete.add([f"not every stage of every task, once and in order: {stage}"])
                return
            self._sha256s[record.agent].update(line)
            self._check(record)
            num_read += 1
        num_read += sum(1 for _ in records)
        if num_read != len(expected):
            self.complete.add([f"{num_read} records of {len(expected)} stages"])

    def _check(self, record: StageRecord) -> None:
        where = _stage_name(record.agent, record.task_id, record.stage)
        if not record.is_scored and record.state is not EndState.GUIDED:
            self.complete.add([f"it is {record.state.value}"], where)
        if record.stage == 1:
            self._before, self._spec = None, self._read_spec(record.task_id)
        if self._spec is not None:
            stage = self._spec.stages[record.stage - 1]
            self.targets.add(target_findings(record, self._spec), where)
            self.targets.add(change_findings(record, stage, self._protocol), where)
        self.paths.add(path_findings(record, self._before, self._protocol), where)
        self._before = brief(record)
        self.rows[record.agent].append(metrics_of(self._before))

    def _read_spec(self, task_id: str) -> EpisodeSpec | None:
        try:
            return Backend().tasks.create(self._known[task_id].path)
        except EvonavError as error:
            self.targets.add([f"the task to verify with cannot be read: {error}"], task_id)
            return None


def _agent_findings(agents: Sequence[str]) -> Iterator[str]:
    if not agents:
        yield "there is no agent"
    for agent, number in Counter(agents).items():
        if number > 1:
            yield f"{agent} is there twice"
        if agent in ORACLE_BASELINE_NAMES:
            yield f"{agent} is an oracle baseline: it knows what agents do not"


def _stage_name(agent: str, task_id: str, stage: int) -> str:
    return f"{agent} {task_id} stage {stage}"


def verify(
    path: Path,
    tasks: Sequence[TaskFile],
    *,
    limit: int | None = None,
    scores_only: bool = False,
    num_workers: int = 0,
    on_progress: Callable[[int, int], None] = lambda _done, _all: None,
) -> PackVerdict:
    """Verify a submission.

    Args:
        tasks: All tasks that the submission has to contain.
        limit: Require only the first tasks, and execute only their actions again. Default: all.
        scores_only: Compute scores from the recorded paths instead of executing the actions again.
        num_workers: Number of processes; 0 runs in this one.
        on_progress: Called with the number of episodes executed again, and of all.
    """
    known = {task.task_id: task for task in tasks}
    required = list(known)[:limit]
    try:
        return _verdict(path, known, required, None if scores_only else (num_workers, on_progress))
    except SubmissionError as error:
        return PackVerdict(
            (PackCheck("file", False, _shown(str(error), len(str(path)) + 2 * MAX_FINDING)),), None, False
        )


def _verdict(
    path: Path,
    known: Mapping[str, TaskFile],
    required: Sequence[str],
    replay: tuple[int, Callable[[int, int], None]] | None,
) -> PackVerdict:
    header = read_header(path)
    agents = ", ".join(header.agents)
    checks = [
        _check("protocol", _protocol_findings(header), "the benchmark's"),
        _check("tasks", _task_findings(header, known, required), f"{len(header.tasks)}, all known"),
    ]
    if not all(check.is_passed for check in checks):
        unread = PackCheck("file", True, _shown(f"the header; the records of {agents} were not read"))
        return PackVerdict((unread, *checks), header, False)
    records = _Records(path, header, known)
    num_records = sum(map(len, records.rows.values()))
    checks.insert(0, PackCheck("file", True, _shown(f"records: {num_records}, agents: {agents}")))
    checks.append(records.complete.check("complete", "every stage once, and scored"))
    if not all(check.is_passed for check in checks):
        return PackVerdict(tuple(checks), header, False)
    checks.append(records.targets.check("targets", "houses, goals, targets and changes are those of the tasks"))
    follows = "lengths, distances, success and SPL follow from the recorded paths"
    checks.append(records.paths.check("paths", follows))
    checks.append(_check("scores", _claims(header, records.rows), "the claimed summary is that of the records"))
    if replay is not None:
        found = _rescore(path, header, known, required, *replay)
        checks.append(_check("actions", found, "replayed, they give the same records, byte for byte"))
    chosen = {agent: [row for row in mine if row.task_id in set(required)] for agent, mine in records.rows.items()}
    num_stages = sum(task.num_stages for task in header.tasks if task.task_id in set(required))
    summary = packed_summary(chosen, num_stages)
    return PackVerdict(tuple(checks), header, replay is not None, summary, records.digests)


def verdict_json(verdict: PackVerdict) -> dict[str, Any]:
    """Return a verdict as JSON values."""
    header = verdict.submission
    return {
        "is_accepted": verdict.is_accepted,
        "is_rescored": verdict.is_rescored,
        "checks": [asdict(check) for check in verdict.checks],
        "about": None if header is None else header.about.model_dump(),
        "summary": verdict.summary,
    }


def _protocol_findings(header: Submission) -> Iterator[str]:
    claimed = header.config.get("protocol")
    if not isinstance(claimed, dict):
        yield "the header has no protocol"
        return
    expected = asdict(ProtocolConfig())
    for name in sorted(expected.keys() | claimed.keys()):
        value, right = claimed.get(name), expected.get(name)
        if value != right or type(value) is not type(right):
            yield f"{name} is {value!r}, the benchmark's is {right!r}"
    yield from _camera_findings(header)


def _camera_findings(header: Submission) -> Iterator[str]:
    backend = header.config.get("backend")
    try:
        camera_of(backend if isinstance(backend, dict) else {})
    except InvalidArgumentError as error:
        yield f"backend.simulator_options.{error}"


def _task_findings(header: Submission, known: Mapping[str, TaskFile], required: Sequence[str]) -> Iterator[str]:
    if not header.tasks:
        yield "there is none"
    for task in header.tasks:
        there = known.get(task.task_id)
        if there is None:
            yield f"{task.task_id} is not among the tasks to verify with"
        elif there.num_stages != task.num_stages or task.digest != there.digest:
            yield f"{task.task_id} is another task than the one of this name"
    names = [task.task_id for task in header.tasks]
    if names != sorted(set(names)):
        yield "they are not each there once, in order"
    packed = set(names)
    missing = set(required) - packed
    if missing and packed == set(required[: len(packed)]):
        yield f"only the first {len(packed)} of {len(required)} are there: --limit {len(packed)} verifies those"
        return
    for name in sorted(missing):
        yield f"{name} is missing"


def _claims(header: Submission, rows: Mapping[str, Sequence[RecordMetrics]]) -> Iterator[str]:
    num_stages = sum(task.num_stages for task in header.tasks)
    claimed, computed = header.summary, packed_summary(rows, num_stages)
    for one in json_differences(claimed, computed, is_equal=_is_close):
        yield f"{one.path} is {one.left}, the records give {one.right}"


def _is_close(claimed: Any, computed: Any) -> bool:  # noqa: ANN401 - JSON
    if isinstance(claimed, float) and isinstance(computed, float):
        return math.isclose(claimed, computed, abs_tol=TOLERANCE)
    return bool(claimed == computed) and type(claimed) is type(computed)


def _rescore(
    path: Path,
    header: Submission,
    known: Mapping[str, TaskFile],
    required: Sequence[str],
    num_workers: int,
    on_progress: Callable[[int, int], None],
) -> Iterator[str]:
    stated = header.config.get("backend")
    backend: dict[str, Any] = stated if isinstance(stated, dict) else {}
    simulator = str(backend.get("simulator", ""))
    module, _, name = simulator.partition(":")
    if module != Backend.__module__ or name not in _OUR_SIMULATORS:
        yield f"simulator {simulator!r}: actions can be replayed only in evonav's own simulator (see --scores-only)"
        return
    settings = {"protocol": header.config["protocol"], "simulator": simulator, "camera": camera_of(backend)}
    chosen = set(required)
    num_episodes = len(header.agents) * len(chosen & {task.task_id for task in header.tasks})
    names: list[tuple[str, str]] = []

    def jobs() -> Iterator[Job]:
        for name, mine in groupby(read_records(path), key=lambda read: (read[0].agent, read[0].task_id)):
            if name[1] in chosen:
                names.append(name)
                records = [line.decode() for _, line in mine]
                yield Job(len(names) - 1, json.dumps({"path": str(known[name[1]].path), "records": records}))

    work = "evonav.submission.rescore:work"
    with open_pool(work, json.dumps(settings), Workforce(num_workers), timeout_s=EPISODE_TIMEOUT_S) as pool:
        for num_done, answer in enumerate(answers(pool, jobs()), start=1):
            on_progress(num_done, num_episodes)
            agent, task_id = names[answer.key]
            if answer.failure is not None:
                yield f"{agent} {task_id}: {answer.detail.strip().splitlines()[-1]}"
                continue
            for stage, differences in json.loads(answer.text):
                yield f"{agent} {task_id} stage {stage}: {'; '.join(differences)}"


def _check(name: str, findings: Iterator[str], if_none: str) -> PackCheck:
    found = _Findings()
    found.add(findings)
    return found.check(name, if_none)


def _shown(text: str, length: int = MAX_FINDING) -> str:
    """Return a text of a file as it can be printed: on one line, without control characters, cut if it is long."""
    line = "".join(letter if letter.isprintable() else " " for letter in text[:length])
    return line if len(text) <= length else f"{line[:-1]}…"
