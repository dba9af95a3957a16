"""Record the outcome of each house of a run in an append-only file; an interruption loses at most one line.

`journal.jsonl` begins with the identity of the run; one line a house follows, in the order in which the houses were
finished. At the end it is rewritten in the order of the houses, so that equal runs leave equal files. The journal is
the only record of progress: `dataset.json` is derived from it.
"""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, get_args

from pydantic import NonNegativeInt, ValidationError

from evonav.errors import StoreError
from evonav.parallel.folders import check_same_run, write_atomically
from evonav.parallel.pool import FailureKind
from evonav.records import Record, sentence_of
from evonav.tasks.dataset import HouseRejection, TaskEntry

NAME = "journal.jsonl"


class Outcome(Record):
    """The outcome of a house: a task, or the reason why it gives none."""

    index: NonNegativeInt
    """Index of the house in its source."""
    house: str
    task: TaskEntry | None = None
    rejection: HouseRejection | None = None

    @property
    def is_failure(self) -> bool:
        """Whether the generator itself failed."""
        return self.rejection is not None and self.rejection.reason in get_args(FailureKind)


class Journal:
    """Reader and writer of `DIR/journal.jsonl`; the caller holds the folder's lock."""

    def __init__(self, folder: Path, run: Mapping[str, Any]) -> None:
        """Open the journal of a run, or begin it.

        Args:
            run: Identity of the run: everything that determines its tasks, as JSON values.

        Raises:
            StoreError: The folder holds another run, or tasks without a journal; or the journal is damaged before its
                last line, or cannot be written.
        """
        self.path = folder / NAME
        self.outcomes: dict[int, Outcome] = {}
        """Outcomes by the index of their house."""
        self._run = json.loads(json.dumps(dict(run)))
        if self.path.exists():
            self._read(folder)
        elif any(folder.glob("*/task.json")):
            problem = f"holds tasks that this command did not make ({NAME} not found)"
            raise StoreError(f"{folder} {problem}; use another folder")
        else:
            write_atomically(self.path, _line(self._run))
        try:
            self._file = self.path.open("a", encoding="utf-8")
        except OSError as error:
            raise StoreError(f"{self.path}: {error}") from error

    def add(self, outcome: Outcome) -> None:
        """Append the outcome of a house.

        Raises:
            StoreError: The file cannot be written.
        """
        try:
            self._file.write(outcome.model_dump_json(exclude_defaults=True) + "\n")
            self._file.flush()
        except OSError as error:
            raise StoreError(f"{self.path}: {error}") from error
        self.outcomes[outcome.index] = outcome

    def ordered_outcomes(self) -> list[Outcome]:
        """Return the outcomes in the order of the houses."""
        return [self.outcomes[index] for index in sorted(self.outcomes)]

    def drop(self, indices: list[int]) -> None:
        """Remove the outcomes of houses that have to be done again."""
        for index in indices:
            del self.outcomes[index]
        if indices:
            self.rewrite()

    def rewrite(self) -> None:
        """Rewrite the journal in the order of the houses.

        Raises:
            StoreError: The file cannot be written.
        """
        self._file.close()
        lines = [outcome.model_dump_json(exclude_defaults=True) for outcome in self.ordered_outcomes()]
        write_atomically(self.path, "".join([_line(self._run), *(line + "\n" for line in lines)]))
        self._file = self.path.open("a", encoding="utf-8")

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def _read(self, folder: Path) -> None:
        num_bytes = 0
        for number, line in enumerate(self._complete_lines(), start=1):
            num_bytes += len(line)
            try:
                if number == 1:
                    stored = json.loads(line)
                    if not isinstance(stored, dict):
                        raise ValueError("not a JSON object")
                    check_same_run(stored, self._run, folder)
                else:
                    outcome = Outcome.model_validate_json(line)
                    self.outcomes[outcome.index] = outcome
            except (ValueError, ValidationError) as error:
                subject = "the run" if number == 1 else "a house"
                advice = "use another folder" if number == 1 else "remove the line to process the house again"
                problem = sentence_of(error) if isinstance(error, ValidationError) else str(error).splitlines()[0]
                raise StoreError(f"{self.path}:{number}: not the record of {subject}: {problem}; {advice}") from None
        if not num_bytes:
            raise StoreError(f"{self.path}: empty; remove it if the folder holds no tasks")
        with self.path.open("r+b") as file:
            file.truncate(num_bytes)

    def _complete_lines(self) -> Iterator[bytes]:
        """Yield all lines except an unfinished last one, left by a kill or a full disk."""
        try:
            with self.path.open("rb") as file:
                yield from (line for line in file if line.endswith(b"\n"))
        except OSError as error:
            raise StoreError(f"{self.path}: {error}") from error


def _line(run: Mapping[str, Any]) -> str:
    return json.dumps(run, sort_keys=True, separators=(",", ":")) + "\n"
