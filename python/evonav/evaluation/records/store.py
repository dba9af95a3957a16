"""Store a run on disk: one SQLite file (WAL) whose rows are whole stages.

A finished stage is one transaction: it is stored completely or not at all. A stage that is reported twice is an error,
by its primary key. Data that is not a function of the run's inputs is not in the records, so that records of equal runs
are equal to the byte: wall-clock times are in `timings`, failed attempts with their tracebacks in `failures`.
"""

import json
import os
import shutil
import sqlite3
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

from pydantic import ValidationError

from evonav.errors import StoreError
from evonav.evaluation.records.encoded import EncodedStage, invalid_record
from evonav.evaluation.records.floor_plans import FloorPlan, FloorPlanReader
from evonav.evaluation.records.schema import SCHEMA_VERSION, EndState, ErrorKind, StageFailure, StageRecord
from evonav.parallel.folders import is_on_network, sync_folder
from evonav.records import sentence_of

FILE_NAME = "records.sqlite"
_ADD_FAILURE = (
    "INSERT INTO failures (agent, task_id, stage, kind, message, traceback, is_retried) VALUES (?, ?, ?, ?, ?, ?, ?)"
)

_TABLES = {
    "meta": "(key TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID",
    "stages": """(
    agent TEXT NOT NULL, task_id TEXT NOT NULL, stage INTEGER NOT NULL,
    state TEXT NOT NULL CHECK (state IN ('success', 'failure', 'errored', 'not_run', 'guided')),
    record TEXT NOT NULL,
    PRIMARY KEY (agent, task_id, stage)
) WITHOUT ROWID""",
    "floor_plans": """(
    task_id TEXT NOT NULL, stage INTEGER NOT NULL, floor_plan TEXT NOT NULL,
    PRIMARY KEY (task_id, stage)
) WITHOUT ROWID""",
    "timings": """(
    agent TEXT NOT NULL, task_id TEXT NOT NULL, stage INTEGER NOT NULL,
    wall_s REAL NOT NULL, cpu_s REAL NOT NULL,
    PRIMARY KEY (agent, task_id, stage)
) WITHOUT ROWID""",
    # Derived from the record (`evonav.evaluation.metrics.stage_metrics`), so that tables need no traces.
    "metrics": """(
    agent TEXT NOT NULL, task_id TEXT NOT NULL, stage INTEGER NOT NULL,
    metrics TEXT NOT NULL,
    PRIMARY KEY (agent, task_id, stage)
) WITHOUT ROWID""",
    "costs": """(
    agent TEXT NOT NULL, task_id TEXT NOT NULL, stage INTEGER NOT NULL,
    costs TEXT NOT NULL,
    PRIMARY KEY (agent, task_id, stage)
) WITHOUT ROWID""",
    "failures": """(
    id INTEGER PRIMARY KEY,
    agent TEXT NOT NULL, task_id TEXT NOT NULL, stage INTEGER NOT NULL,
    kind TEXT NOT NULL, message TEXT NOT NULL, traceback TEXT NOT NULL, is_retried INTEGER NOT NULL
)""",
}


@dataclass(frozen=True, slots=True)
class FailureRow:
    """A failed attempt at a stage; the last one of an errored stage is the reason of its error."""

    agent: str
    task_id: str
    stage: int
    kind: ErrorKind
    message: str
    traceback: str
    """Empty where a process was lost."""
    is_retried: bool
    """True if the stage was tried again after it."""


def holds_run(run_dir: Path) -> bool:
    """Return whether a run was begun in a folder; a file without tables is of one that ended as it was created.

    Raises:
        StoreError: The file cannot be read.
    """
    path = run_dir / FILE_NAME
    if not path.is_file():
        return False
    try:
        with closing(_connect(path)) as db:
            return bool(db.execute("SELECT 1 FROM sqlite_master WHERE name = 'meta'").fetchall())
    except sqlite3.Error as error:
        raise StoreError(f"{path}: {error}") from error


def _connect(path: Path) -> sqlite3.Connection:
    """Open a file of records; one that lies where nothing can be written is taken to stay as it is.

    SQLite reads a file with a write-ahead log only where it can make files beside it, or if it is told this.
    """
    is_still = (
        path.is_file() and not os.access(path.parent, os.W_OK) and not path.with_name(f"{path.name}-wal").exists()
    )
    name = f"{path.absolute().as_uri()}?mode=ro&immutable=1" if is_still else str(path)
    return sqlite3.connect(name, isolation_level=None, timeout=30.0, uri=is_still)


class RunStore:
    """Reads and writes `DIR/records.sqlite`. One process writes; any number read meanwhile."""

    def __init__(self, run_dir: Path, *, create: bool = False) -> None:
        """Open the run in `run_dir`.

        Raises:
            StoreError: There is no run there and `create` is false, the file is not a run of this schema version, or
                it cannot be opened.
        """
        self.path = run_dir / FILE_NAME
        if not create and not self.path.is_file():
            raise StoreError(f"{run_dir}: {_why_no_run(run_dir)}")
        try:
            if create:
                run_dir.mkdir(parents=True, exist_ok=True)
            self._db = _connect(self.path)
        except (sqlite3.Error, OSError) as error:
            raise StoreError(f"{self.path}: {error}") from error
        try:
            self._open(create)
        except (sqlite3.Error, OSError) as error:
            self._db.close()
            raise StoreError(f"{self.path}: {error}") from error
        except BaseException:
            self._db.close()
            raise

    def _open(self, create: bool) -> None:
        for pragma in ("synchronous = FULL", "temp_store = MEMORY"):
            self._db.execute(f"PRAGMA {pragma}")
        if create:
            # A write-ahead log needs memory that all readers share, which a network file system does not give.
            self._db.execute(f"PRAGMA journal_mode = {'DELETE' if is_on_network(self.path.parent) else 'WAL'}")
            sync_folder(self.path.absolute().parent.parent)
            with self._transaction():
                there = {name for (name,) in self._db.execute("SELECT name FROM sqlite_master")}
                for name in _TABLES.keys() - there:
                    self._db.execute(f"CREATE TABLE {name} {_TABLES[name]}")
                if "meta" not in there:
                    self._db.execute("INSERT INTO meta VALUES ('schema_version', ?)", (_json(SCHEMA_VERSION),))
        version = self.meta("schema_version")
        if type(version) is not int or version != SCHEMA_VERSION:
            raise StoreError(f"{self.path}: schema version {version}, this evonav reads {SCHEMA_VERSION}")

    def __enter__(self) -> "RunStore":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the file; safe to call twice."""
        self._db.close()

    def meta(self, key: str) -> Any:  # noqa: ANN401 - JSON
        """Return a JSON value of the run's header, or `None`."""
        rows = self._query("SELECT value FROM meta WHERE key = ?", (key,))
        return json.loads(rows[0][0]) if rows else None

    def set_meta(self, key: str, value: Any) -> None:  # noqa: ANN401 - JSON
        """Set a JSON value of the run's header."""
        self.set_header({key: value})

    def set_header(self, values: Mapping[str, Any]) -> None:
        """Set JSON values of the run's header, all or none."""
        with self._transaction():
            rows = [(key, _json(value)) for key, value in values.items()]
            self._db.executemany("INSERT OR REPLACE INTO meta VALUES (?, ?)", rows)

    def states(self) -> dict[tuple[str, str, int], EndState]:
        """Return the end state of every recorded (agent, task, stage)."""
        rows = self._query("SELECT agent, task_id, stage, state FROM stages")
        return {(agent, task_id, stage): EndState(state) for agent, task_id, stage, state in rows}

    def add_stage(self, stage: EncodedStage) -> None:
        """Commit a finished stage: its record, metrics, time and costs, and the failure of an errored one.

        Raises:
            StoreError: The stage is already recorded, or the file cannot be written.
        """
        key = stage.key
        with self._transaction(f"stage {key}: "):
            self._db.execute("INSERT INTO stages VALUES (?, ?, ?, ?, ?)", (*key, stage.state.value, stage.record))
            self._db.execute("INSERT INTO metrics VALUES (?, ?, ?, ?)", (*key, stage.metrics))
            self._db.execute("INSERT INTO timings VALUES (?, ?, ?, ?, ?)", (*key, stage.wall_s, stage.cpu_s))
            if stage.costs is not None:
                self._db.execute("INSERT INTO costs VALUES (?, ?, ?, ?)", (*key, _json(stage.costs)))
            if stage.failure is not None:
                row = (*key, stage.failure.kind.value, stage.failure.message, stage.failure.traceback, False)
                self._db.execute(_ADD_FAILURE, row)

    def add_retry(self, agent: str, task_id: str, failure: StageFailure) -> None:
        """Record a failure after which the stage is tried again."""
        what = (failure.kind.value, failure.message, failure.traceback, True)
        self._execute(_ADD_FAILURE, (agent, task_id, failure.stage, *what))

    def add_floor_plan(self, task_id: str, stage: int, text: str) -> None:
        """Store the floor plan of a stage, as JSON; a stored one stays, as all writers would write the same."""
        self._execute("INSERT OR IGNORE INTO floor_plans VALUES (?, ?, ?)", (task_id, stage, text))

    def floor_plan_keys(self) -> set[tuple[str, int]]:
        """Return task and stage of every stored floor plan."""
        return set(self._query("SELECT task_id, stage FROM floor_plans"))

    def forget_episode(self, agent: str, task_id: str, from_stage: int) -> None:
        """Drop an episode's stages from `from_stage` on, so that they can be run again."""
        key = (agent, task_id, from_stage)
        with self._transaction():
            for table in _TABLES.keys() - {"meta", "floor_plans"}:
                self._db.execute(f"DELETE FROM {table} WHERE agent = ? AND task_id = ? AND stage >= ?", key)  # noqa: S608

    def records(
        self, agent: str | None = None, task_id: str | None = None, *, is_brief: bool = False
    ) -> Iterator[StageRecord]:
        """Yield stage records by agent, task and stage.

        Args:
            agent: Read only this agent's records.
            task_id: Read only this task's records.
            is_brief: Leave out traces and entries, which are most of a record; stored metrics replace them.

        Raises:
            StoreError: A row is not a valid record.
        """
        for text in self._texts(
            "json_remove(record, '$.trace', '$.entries')" if is_brief else "record", agent, task_id
        ):
            yield self._parsed(text)

    @contextmanager
    def snapshot(self) -> Iterator[None]:
        """Read one consistent state inside the block, whatever another process writes meanwhile.

        Without a write-ahead log, on a network file system, there is no snapshot: a reader would block the writer.
        """
        if list(self._rows("PRAGMA journal_mode")) != [("wal",)]:
            yield
            return
        self._db.execute("BEGIN")
        try:
            yield
        finally:
            self._db.execute("ROLLBACK")

    def record_texts(self, agent: str | None = None, task_id: str | None = None) -> Iterator[str]:
        """Yield the records as stored, in the order of `records`: equal runs give equal texts."""
        return self._texts("record", agent, task_id)

    def _texts(self, column: str, agent: str | None, task_id: str | None) -> Iterator[str]:
        wanted = {name: value for name, value in (("agent", agent), ("task_id", task_id)) if value is not None}
        query = f"SELECT {column} FROM stages {_where(wanted)} ORDER BY agent, task_id, stage"  # noqa: S608
        return (text for (text,) in self._rows(query, tuple(wanted.values())))

    def record(self, agent: str, task_id: str, stage: int) -> StageRecord:
        """Return one whole record.

        Raises:
            StoreError: There is no such record, or it is not valid.
        """
        text = self.record_text(agent, task_id, stage)
        if text is None:
            raise StoreError(f"{self.path}: no record of {agent}, {task_id}, stage {stage}")
        return self._parsed(text)

    def _parsed(self, text: str) -> StageRecord:
        try:
            return StageRecord.model_validate_json(text)
        except ValidationError as error:
            raise StoreError(f"{self.path}: {invalid_record(text, error)}") from error

    def encoded_metrics(self) -> Iterator[tuple[tuple[str, str, int], str]]:
        """Yield agent, task and stage, and the stage's encoded metrics, in this order."""
        query = "SELECT agent, task_id, stage, metrics FROM metrics ORDER BY agent, task_id, stage"
        for agent, task_id, stage, metrics in self._rows(query):
            yield (agent, task_id, stage), metrics

    def record_text(self, agent: str, task_id: str, stage: int) -> str | None:
        """Return one record as stored, or `None`."""
        query = "SELECT record FROM stages WHERE agent = ? AND task_id = ? AND stage = ?"
        rows = self._query(query, (agent, task_id, stage))
        return str(rows[0][0]) if rows else None

    def floor_plans(self, task_id: str | None = None) -> Iterator[FloorPlan]:
        """Yield floor plans by task and stage."""
        wanted = {} if task_id is None else {"task_id": task_id}
        query = f"SELECT floor_plan FROM floor_plans {_where(wanted)} ORDER BY task_id, stage"  # noqa: S608
        reader = FloorPlanReader()
        for (text,) in self._rows(query, tuple(wanted.values())):
            try:
                yield reader.read(text)
            except ValidationError as error:
                raise StoreError(f"{self.path}: a floor plan is not valid: {sentence_of(error)}") from error

    def num_rooms(self) -> dict[str, int]:
        """Return the number of rooms of each task's house, by its first stored floor plan."""
        rooms = "json_type(floor_plan, '$.rooms'), json_array_length(floor_plan, '$.rooms')"
        rows = self._query(f"SELECT task_id, min(stage), {rooms} FROM floor_plans GROUP BY task_id")  # noqa: S608
        if wrong := [f"{task_id}/{stage}: rooms = {kind}" for task_id, stage, kind, _ in rows if kind != "array"]:
            raise StoreError(f"{self.path}: floor plan of {wrong[0]}: expected an array")
        return {row[0]: row[3] for row in rows}

    def timings(self) -> dict[tuple[str, str, int], tuple[float, float]]:
        """Return wall and CPU seconds of every recorded stage; not deterministic, hence not in the records."""
        rows = self._query("SELECT agent, task_id, stage, wall_s, cpu_s FROM timings")
        return {(agent, task_id, stage): (wall_s, cpu_s) for agent, task_id, stage, wall_s, cpu_s in rows}

    def costs(self) -> dict[tuple[str, str, int], dict[str, Any]]:
        """Return the other costs of the stages, by field of `StageCosts`; like `timings`, not in the records."""
        rows = self._query("SELECT agent, task_id, stage, costs FROM costs")
        return {(agent, task_id, stage): json.loads(costs) for agent, task_id, stage, costs in rows}

    def failures(self) -> list[FailureRow]:
        """Return the failed attempts by agent, task and stage, in the order in which they happened."""
        rows = self._query(
            "SELECT agent, task_id, stage, kind, message, traceback, is_retried FROM failures "
            "ORDER BY agent, task_id, stage, id"
        )
        return [
            FailureRow(agent, task_id, stage, ErrorKind(kind), message, traceback, bool(is_retried))
            for agent, task_id, stage, kind, message, traceback, is_retried in rows
        ]

    def retries(self) -> Counter[tuple[str, str, int]]:
        """Count how often stages were tried again, by agent, task and stage."""
        return Counter((one.agent, one.task_id, one.stage) for one in self.failures() if one.is_retried)

    def _rows(self, query: str, values: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
        try:
            yield from self._db.execute(query, values)
        except sqlite3.Error as error:
            raise StoreError(f"{self.path}: {error}") from error

    def _query(self, query: str, values: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
        return list(self._rows(query, values))

    def _execute(self, query: str, values: tuple[Any, ...]) -> None:
        with self._transaction():
            self._db.execute(query, values)

    @contextmanager
    def _transaction(self, what: str = "") -> Iterator[None]:
        """Commit all changes inside the block, or none."""
        try:
            self._db.execute("BEGIN IMMEDIATE")
            yield
            self._db.execute("COMMIT")
        except sqlite3.Error as error:
            with suppress(sqlite3.Error):  # a disk that is full may have ended it already
                if self._db.in_transaction:
                    self._db.execute("ROLLBACK")
            free_mb = shutil.disk_usage(self.path.parent).free >> 20
            raise StoreError(
                f"{self.path}: {what}{error} ({free_mb} MB are free there); "
                "what is recorded is safe, and the same command goes on from it"
            ) from error


def _why_no_run(run_dir: Path) -> str:
    """Explain why a folder is no run, and name one that may have been meant."""
    if not run_dir.is_dir():
        return f"no run here (there is no such folder); `evonav evaluate --out {run_dir}` makes one"
    inner = sorted(path.parent for path in (*run_dir.glob(f"*/{FILE_NAME}"), *run_dir.glob(f"runs/*/{FILE_NAME}")))
    if inner:
        return f"no run here, but {len(inner)} below: name one, such as {inner[0]}"
    return f"no run here ({FILE_NAME} not found)"


def _where(columns: Collection[str]) -> str:
    """Return the condition that columns have given values; SQLite looks those up that begin a table's key."""
    return "WHERE " + " AND ".join(f"{column} = ?" for column in columns) if columns else ""


def _json(value: Any) -> str:  # noqa: ANN401 - JSON
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)
