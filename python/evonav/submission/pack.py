"""Pack a run into one file: a zip of every record, the configuration, the tasks' checksums and the claimed scores.

The same run gives the same bytes. Reading trusts nothing: names, sizes and checksums are checked before a member is
parsed, nothing is extracted to disk, and nothing that the file names is imported.
"""

import hashlib
import json
import zipfile
import zlib
from collections.abc import Iterator, Sequence
from datetime import datetime, timezone
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from evonav.errors import InvalidArgumentError, StoreError
from evonav.evaluation.agent_order import agents_in_order
from evonav.evaluation.baselines import BASELINES
from evonav.evaluation.metrics.navigation import agent_pairs, summarise, summary_json
from evonav.evaluation.records.schema import EndState, StageRecord
from evonav.evaluation.records.store import RunStore
from evonav.evaluation.run.provenance import KEY as SESSIONS_KEY
from evonav.evaluation.run.run import SEALED_KEY
from evonav.parallel.folders import replacing

SUFFIX = ".evonav.zip"
HEADER_NAME = "submission.json"
MAX_TOTAL_BYTES = 2 << 30
MAX_RATIO = 100
"""Largest ratio of uncompressed to compressed size of a member; records have 10 to 30."""
MAX_HEADER_BYTES = 64 << 20
MAX_LINE_BYTES = 64 << 20
_EPOCH = (1980, 1, 1, 0, 0, 0)
"""Time stamp of the members if it is not known when the run began."""
_Time = tuple[int, int, int, int, int, int]


class SubmissionError(StoreError):
    """A file that is not a submission, or not a whole one."""


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class PackedTask(_Part):
    """A task of the run."""

    task_id: str
    num_stages: int = Field(ge=1)
    digest: str
    """SHA-256 of `task.json`, which holds the checksums of all other files of the task."""


class PackedRecords(_Part):
    """The records of one agent: a member of the archive, a line a stage."""

    agent: str
    member: str
    num_bytes: int
    """Size before compression."""
    sha256: str
    """Checksum of the uncompressed bytes."""


class About(_Part):
    """Statements of the submitters, which cannot be checked."""

    title: str = ""
    authors: str = ""
    contact: str = ""
    url: str = ""
    description: str = ""


class Submission(_Part):
    """The header of the archive."""

    format_version: Literal[1] = 1
    evonav: str
    """Version of evonav that packed the file."""
    about: About
    config: dict[str, Any]
    """The run's protocol, seed, simulator, perception and decision model; only protocol and simulator are checked."""
    tasks: tuple[PackedTask, ...]
    records: tuple[PackedRecords, ...]
    summary: dict[str, Any]
    """The claimed scores: `summary.json` of these agents."""


def pack(
    run_dir: Path,
    out: Path,
    *,
    agents: Sequence[str] | None = None,
    about: About | None = None,
    reveals_sealed: bool = False,
) -> Submission:
    """Write a submission.

    Args:
        run_dir: A complete run.
        out: The file to write, whole or not at all.
        agents: Names of agents of the run; default: all but baselines.
        about: Title, authors and other statements.
        reveals_sealed: Pack a run on sealed tasks, too: records tell where targets are.

    Raises:
        InvalidArgumentError: An agent is not of the run, is a baseline, or has stages without a score; or the tasks are
            sealed.
        StoreError: There is no run, it was made by an earlier version, or the file cannot be written.
    """
    with RunStore(run_dir) as store:
        if store.meta(SEALED_KEY) and not reveals_sealed:
            raise InvalidArgumentError(
                f"{run_dir}: its tasks are sealed, and records tell where their targets are: publish summary.json; "
                "--reveal packs the run for whoever may know"
            )
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


class SubmissionFile:
    """An archive that claims to be a submission."""

    def __init__(self, path: Path) -> None:
        """Open the archive and read its header.

        Raises:
            SubmissionError: It is not a zip, its members are not those of a submission, or the header is malformed.
        """
        self.path = path
        try:
            self._archive = zipfile.ZipFile(path)
        except (OSError, zipfile.BadZipFile) as error:
            raise SubmissionError(f"{path}: not a submission ({error})") from error
        self.header = self._read_header()
        self._check_members()

    @property
    def date(self) -> str | None:
        """Day on which the run began, such as `2026-11-23`, by the archive's time stamps; `None` if they tell none."""
        time = self._archive.getinfo(HEADER_NAME).date_time
        return None if time == _EPOCH else "{:04}-{:02}-{:02}".format(*time)

    def __enter__(self) -> "SubmissionFile":
        return self

    def __exit__(self, *_: object) -> None:
        self._archive.close()

    def texts(self, part: PackedRecords) -> Iterator[str]:
        """Yield the lines of a member, one record each.

        Raises:
            SubmissionError: The member is not what the header says.
        """
        digest, size = hashlib.sha256(), 0
        try:
            with self._archive.open(part.member) as file:
                while line := file.readline(MAX_LINE_BYTES):
                    size += len(line)
                    if size > part.num_bytes:
                        raise SubmissionError(
                            f"{self.path}: {part.member}: longer than the {part.num_bytes} B in the header"
                        )
                    digest.update(line)
                    yield line.decode()[:-1]
        except (OSError, zipfile.BadZipFile, zlib.error, EOFError, UnicodeDecodeError, NotImplementedError) as error:
            raise SubmissionError(f"{self.path}: {part.member}: {type(error).__name__}: {error}") from error
        if size != part.num_bytes or digest.hexdigest() != part.sha256:
            raise SubmissionError(f"{self.path}: {part.member}: {size} B of another checksum than the header's")

    def _read_header(self) -> Submission:
        infos = [info for info in self._archive.infolist() if info.filename == HEADER_NAME]
        if len(infos) != 1 or infos[0].file_size > MAX_HEADER_BYTES:
            raise SubmissionError(f"{self.path}: not a submission ({HEADER_NAME}: {len(infos)} times, expected once)")
        self._check_member(infos[0])
        try:
            return Submission.model_validate_json(self._archive.read(infos[0]))
        except ValidationError as error:
            first = error.errors()[0]
            where = ".".join(str(part) for part in first["loc"])
            raise SubmissionError(f"{self.path}: {HEADER_NAME}: {where}: {first['msg']}") from error
        except (OSError, zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError) as error:
            raise SubmissionError(f"{self.path}: {HEADER_NAME}: {type(error).__name__}: {error}") from error

    def _check_members(self) -> None:
        expected = [HEADER_NAME, *(part.member for part in self.header.records)]
        found = [info.filename for info in self._archive.infolist()]
        if sorted(found) != sorted(expected):
            odd = sorted(set(found) ^ set(expected)) or sorted({name for name in found if found.count(name) > 1})
            raise SubmissionError(f"{self.path}: members missing, unknown or twice: {', '.join(map(repr, odd[:5]))}")
        infos = self._archive.infolist()
        total = sum(info.file_size for info in infos)
        if total > MAX_TOTAL_BYTES:
            raise SubmissionError(f"{self.path}: {total} B uncompressed, the limit is {MAX_TOTAL_BYTES}")
        for info in infos:
            self._check_member(info)

    def _check_member(self, info: zipfile.ZipInfo) -> None:
        if info.flag_bits & 0x1 or info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise SubmissionError(f"{self.path}: {info.filename!r}: encrypted, or in another compression than deflate")
        if info.file_size > MAX_RATIO * max(1, info.compress_size):
            raise SubmissionError(f"{self.path}: {info.filename!r}: {info.file_size} B from {info.compress_size}")


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
    config = store.meta("config")
    header = Submission(
        evonav=str(config["evonav"]),
        about=About(),
        config={key: value for key, value in config.items() if key not in ("evonav", "tasks", "num_tasks")},
        tasks=tuple(PackedTask(task_id=name, num_stages=stages[name], digest=digests[name]) for name in sorted(stages)),
        records=tuple(
            PackedRecords(
                agent=agent,
                member=f"records/{number}.jsonl",
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
        return _EPOCH


def _write(archive: zipfile.ZipFile, name: str, data: bytes, time: _Time) -> None:
    info = zipfile.ZipInfo(name, time)
    info.compress_type = zipfile.ZIP_DEFLATED
    info.external_attr = 0o644 << 16
    archive.writestr(info, data)
