"""A SQLite file (WAL) that any number of threads and processes read and write in transactions."""

import sqlite3
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path

from evonav.errors import StoreError

_TIMEOUT_S = 60.0
"""Longest wait for another process to finish its transaction."""


class SharedFile:
    """A file with one schema, opened for reading and writing."""

    def __init__(self, path: Path | str, schema: str, what: str) -> None:
        """Open or create the file.

        Args:
            path: Path of the file; its folder is created if it is missing.
            schema: SQL that creates missing tables.
            what: The content, for error messages.

        Raises:
            StoreError: It cannot be opened or is no such file.
        """
        self.path = Path(path)
        self._what = what
        self._lock = threading.Lock()
        with self._store_errors():
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._db = sqlite3.connect(self.path, timeout=_TIMEOUT_S, check_same_thread=False, isolation_level=None)
            _switch_to_wal(self._db)
            self._db.execute("PRAGMA synchronous = NORMAL")
            self._db.executescript(schema)

    def close(self) -> None:
        """Close the file."""
        with self._reading():
            self._db.close()

    @contextmanager
    def _reading(self) -> Iterator[None]:
        with self._lock, self._store_errors():
            yield

    @contextmanager
    def _writing(self) -> Iterator[None]:
        """Run the block as one exclusive transaction."""
        with self._lock, self._store_errors():
            self._db.execute("BEGIN IMMEDIATE")
            try:
                yield
                self._db.execute("COMMIT")
            except BaseException:
                self._db.execute("ROLLBACK")
                raise

    @contextmanager
    def _store_errors(self) -> Iterator[None]:
        try:
            yield
        except (sqlite3.Error, OSError, ValueError) as error:
            raise StoreError(f"{self.path}: {self._what}: {error}") from error


def fold_log(path: Path) -> None:
    """Move the contents of a file's write-ahead log into the file, and empty the log.

    The last process that closes a file does that, but not one that is killed. A missing file, and one that another
    process uses at this moment, stays as it is.
    """
    with suppress(sqlite3.Error), closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=rw", uri=True)) as db:
        db.execute("PRAGMA wal_checkpoint(TRUNCATE)")


def _switch_to_wal(db: sqlite3.Connection) -> None:
    """Switch a file to WAL, also while other processes open it for the first time.

    SQLite refuses the switch at once, without its timeout, while another process has begun to write.
    """
    deadline = time.monotonic() + _TIMEOUT_S
    while True:
        try:
            db.execute("PRAGMA journal_mode = WAL")
        except sqlite3.OperationalError as error:
            if "locked" not in str(error) or time.monotonic() > deadline:
                raise
            time.sleep(0.005)
        else:
            return
