"""What became of every house of a run: an append-only file of which no interruption costs more than a line.

`journal.jsonl` begins with what the run is; a line a house follows, in the order in which they were done. Once all are
done it is written anew in the order of the houses, so that equal runs leave equal files.
"""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, get_args

from pydantic import NonNegativeInt, ValidationError

from evonav.errors import StoreError
from evonav.parallel.folders import check_same_run, write_atomically
from evonav.parallel.pool import FailureKind
from evonav.tasks.dataset import RejectReason
from evonav.tasks.records import Record, Sha256

NAME = "journal.jsonl"


class Outcome(Record):
    """What became of a house: a task, or a reason why not."""

    index: NonNegativeInt
    """Of the house in its source."""
    house: str
    task_id: str | None = None
    house_sha256: Sha256 | None = None
    task_sha256: Sha256 | None = None
    """Of `task.json`, which holds the checksums of the task's other files."""
    reason: RejectReason | None = None
    stage: NonNegativeInt = 0
    """Of a reason: at which it was found."""
    detail: str = ""
    """Of a reason: a sentence, or the end of a traceback."""

    @property
    def is_failure(self) -> bool:
        """Whether it was the generator that failed."""
        return self.reason in get_args(FailureKind)


class Journal:
    """Reads and writes `DIR/journal.jsonl`; the caller holds the folder's lock."""

    def __init__(self, folder: Path, run: Mapping[str, Any]) -> None:
        """Opens the journal of a run, or begins it.

        Args:
            folder: Where the tasks are.
            run: What decides them, as JSON.

        Raises:
            StoreError: The folder holds another run, or tasks without a journal; or the journal is damaged before its
                last line, or cannot be written.
        """
        self.path = folder / NAME
        self.outcomes: dict[int, Outcome] = {}
        self._run = json.loads(json.dumps(dict(run)))
        if self.path.exists():
            self._read(folder)
        elif any(folder.glob("*/task.json")):
            raise StoreError(f"{folder} holds tasks that this command did not make ({NAME} not found); use another")
        else:
            write_atomically(self.path, _line(self._run))
        try:
            self._file = self.path.open("a", encoding="utf-8")
        except OSError as error:
            raise StoreError(f"{self.path}: {error}") from error

    def add(self, outcome: Outcome) -> None:
        """Records what became of a house.

        Raises:
            StoreError: It cannot be written.
        """
        try:
            self._file.write(outcome.model_dump_json(exclude_defaults=True) + "\n")
            self._file.flush()
        except OSError as error:
            raise StoreError(f"{self.path}: {error}") from error
        self.outcomes[outcome.index] = outcome

    def drop(self, indices: list[int]) -> None:
        """Forgets houses, which are then to be done again."""
        for index in indices:
            del self.outcomes[index]
        if indices:
            self.rewrite()

    def rewrite(self) -> None:
        """Writes the journal anew, in the order of the houses.

        Raises:
            StoreError: It cannot be written.
        """
        self._file.close()
        lines = [self.outcomes[index].model_dump_json(exclude_defaults=True) for index in sorted(self.outcomes)]
        write_atomically(self.path, "".join([_line(self._run), *(line + "\n" for line in lines)]))
        self._file = self.path.open("a", encoding="utf-8")

    def close(self) -> None:
        """Closes the file; what was added is written."""
        self._file.close()

    def __enter__(self) -> "Journal":
        """Nothing."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Closes the file."""
        self.close()

    def _read(self, folder: Path) -> None:
        whole_bytes = 0
        for number, line in enumerate(self._whole_lines(), start=1):
            whole_bytes += len(line)
            try:
                if number == 1:
                    check_same_run(json.loads(line), self._run, folder)
                else:
                    outcome = Outcome.model_validate_json(line)
                    self.outcomes[outcome.index] = outcome
            except (ValueError, AttributeError, ValidationError) as error:
                what = "the run" if number == 1 else "a house"
                advice = "use another folder" if number == 1 else "remove the line to have the house done again"
                raise StoreError(f"{self.path}:{number}: not the record of {what}: {_first(error)}; {advice}") from None
        if not whole_bytes:
            raise StoreError(f"{self.path}: empty; remove it if the folder holds no tasks")
        with self.path.open("r+b") as file:
            file.truncate(whole_bytes)

    def _whole_lines(self) -> Iterator[bytes]:
        """All lines but an unfinished last one, which a kill or a full disk left."""
        try:
            with self.path.open("rb") as file:
                yield from (line for line in file if line.endswith(b"\n"))
        except OSError as error:
            raise StoreError(f"{self.path}: {error}") from error


def _line(run: Mapping[str, Any]) -> str:
    return json.dumps(run, sort_keys=True, separators=(",", ":")) + "\n"


def _first(error: Exception) -> str:
    return str(error).splitlines()[0]
