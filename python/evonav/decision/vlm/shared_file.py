"""A SQLite file (WAL) that any number of threads and processes read and write, a transaction at a time."""

import sqlite3
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from evonav.errors import StoreError


class SharedFile:
    """Base of what is kept in such a file."""

    def __init__(self, path: Path | str, schema: str, what: str) -> None:
        """Opens or makes the file.

        Args:
            path: Its folder is made if need be.
            schema: SQL that makes what is not there.
            what: Is kept, for messages.

        Raises:
            StoreError: It cannot be opened or is no such file.
        """
        self.path = Path(path)
        self._what = what
        self._lock = threading.Lock()
        with self._told():
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._db = sqlite3.connect(self.path, timeout=60.0, check_same_thread=False, isolation_level=None)
            self._db.execute("PRAGMA journal_mode = WAL")
            self._db.execute("PRAGMA synchronous = NORMAL")
            self._db.executescript(schema)

    def close(self) -> None:
        """Closes the file."""
        with self._reading():
            self._db.close()

    @contextmanager
    def _reading(self) -> Iterator[None]:
        with self._lock, self._told():
            yield

    @contextmanager
    def _writing(self) -> Iterator[None]:
        """All of it or nothing, and nobody else's in between."""
        with self._lock, self._told():
            self._db.execute("BEGIN IMMEDIATE")
            try:
                yield
                self._db.execute("COMMIT")
            except BaseException:
                self._db.execute("ROLLBACK")
                raise

    @contextmanager
    def _told(self) -> Iterator[None]:
        try:
            yield
        except (sqlite3.Error, OSError, ValueError) as error:
            raise StoreError(f"{self.path}: {self._what}: {error}") from error
