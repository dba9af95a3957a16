"""Cache exchanges with a model, requests and responses, so that a question is answered again without asking.

An exchange is found by its question alone: the SHA-256 of the request as canonical JSON, each image replaced by the
SHA-256 of its pixels. Images are stored once. No key, address or time is stored, so equal exchanges make equal rows.

A client may also store failures (timeouts, lost connections, a server's errors), in a table of their own, so that they
happen again in a replay.
"""

import hashlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, WebPImagePlugin  # noqa: F401 - or Pillow imports all its plug-ins for the first WebP

from evonav.decision.pictures import Picture
from evonav.decision.vlm.shared_file import SharedFile
from evonav.errors import StoreError

JsonObject = dict[str, Any]

_SCHEMA = """
CREATE TABLE IF NOT EXISTS exchanges (key TEXT PRIMARY KEY, request TEXT NOT NULL, response TEXT NOT NULL) STRICT;
CREATE TABLE IF NOT EXISTS failures (key TEXT PRIMARY KEY, request TEXT NOT NULL, kind TEXT NOT NULL,
    message TEXT NOT NULL) STRICT;
CREATE TABLE IF NOT EXISTS pictures (name TEXT PRIMARY KEY, file BLOB NOT NULL) STRICT;
"""


def canonical_json(value: Any) -> str:  # noqa: ANN401
    """Return JSON with sorted keys and no spaces: one spelling for a value."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False)


def _file_of(picture: Picture) -> bytes:
    """Return the JPEG that the pixels are decoded from, or, of other pixels, a WebP without loss."""
    if isinstance(picture.source, bytes):
        return picture.source
    buffer = BytesIO()
    Image.fromarray(np.ascontiguousarray(picture.source)).save(buffer, "WEBP", lossless=True, method=0, quality=20)
    return buffer.getvalue()


def key_of(request: JsonObject) -> str:
    """Return the key of an exchange: the SHA-256 of a request with names in place of its images."""
    return hashlib.sha256(canonical_json(request).encode()).hexdigest()


@dataclass(frozen=True, slots=True)
class StoredFailure:
    """The outcome of a question without a response."""

    kind: str
    message: str


class ResponseCache(SharedFile):
    """A cache of exchanges in one SQLite file (WAL); any number of threads and processes may use it."""

    def __init__(self, path: Path | str) -> None:
        """Open or create the file; `StoreError` if that fails, or it is no such file."""
        super().__init__(path, _SCHEMA, "exchanges")

    def __len__(self) -> int:
        """Return the number of exchanges."""
        with self._reading():
            return int(self._db.execute("SELECT count(*) FROM exchanges").fetchone()[0])

    @property
    def num_failures(self) -> int:
        """Number of questions that failed."""
        with self._reading():
            return int(self._db.execute("SELECT count(*) FROM failures").fetchone()[0])

    def get(self, key: str) -> JsonObject | None:
        """Return the response stored for a key; `StoreError` if the file is unreadable or it is no JSON object."""
        with self._reading():
            row = self._db.execute("SELECT response FROM exchanges WHERE key = ?", (key,)).fetchone()
        if row is None:
            return None
        try:
            response = json.loads(row[0])
        except ValueError as error:
            raise StoreError(f"{self.path}: response of {key}: {error}") from error
        if not isinstance(response, dict):
            raise StoreError(f"{self.path}: response of {key}: expected an object, got {str(row[0])[:80]!r}")
        return response

    def outcome(self, key: str) -> JsonObject | StoredFailure | None:
        """Return the response or failure stored for a key; `StoreError` as for `get`."""
        response = self.get(key)
        if response is not None:
            return response
        with self._reading():
            return self._failure(key)

    def put(self, request: JsonObject, pictures: Sequence[Picture], response: JsonObject) -> str:
        """Store an exchange in place of an older one with the same question, in one transaction; return its key.

        Args:
            request: The request, with names in place of its images.

        Raises:
            StoreError: The file cannot be written.
        """
        key = key_of(request)
        files = self._new_files(pictures)
        with self._writing():
            self._db.execute("DELETE FROM failures WHERE key = ?", (key,))
            self._db.execute("DELETE FROM exchanges WHERE key = ?", (key,))
            self._insert(key, request, files, response)
        return key

    def keep_first(
        self, request: JsonObject, pictures: Sequence[Picture], outcome: JsonObject | StoredFailure
    ) -> JsonObject | StoredFailure:
        """Store an outcome unless another process has stored one of the same question meanwhile.

        Returns:
            The stored outcome: all who ask the same get the same answer, in this run and in every replay of it.

        Raises:
            StoreError: The file cannot be written.
        """
        key = key_of(request)
        files = self._new_files(pictures)
        with self._writing():
            row = self._db.execute("SELECT response FROM exchanges WHERE key = ?", (key,)).fetchone()
            there: JsonObject | StoredFailure | None = self._failure(key) if row is None else json.loads(row[0])
            if there is None:
                self._insert(key, request, files, outcome)
        return outcome if there is None else there

    def forget_failures(self) -> int:
        """Drop all failures, so that their questions are asked again, and return their number."""
        with self._writing():
            return self._db.execute("DELETE FROM failures").rowcount

    def _failure(self, key: str) -> StoredFailure | None:
        row = self._db.execute("SELECT kind, message FROM failures WHERE key = ?", (key,)).fetchone()
        return None if row is None else StoredFailure(*row)

    def _new_files(self, pictures: Sequence[Picture]) -> dict[str, bytes]:
        """Return the files of images that are not stored yet, by name."""
        by_name = {picture.name: picture for picture in pictures}
        with self._reading():
            query = f"SELECT name FROM pictures WHERE name IN ({','.join('?' * len(by_name))})"  # noqa: S608
            stored = {name for (name,) in self._db.execute(query, tuple(by_name))}
        return {name: _file_of(picture) for name, picture in by_name.items() if name not in stored}

    def _insert(
        self, key: str, request: JsonObject, files: dict[str, bytes], outcome: JsonObject | StoredFailure
    ) -> None:
        self._db.executemany("INSERT OR IGNORE INTO pictures VALUES (?, ?)", files.items())
        if isinstance(outcome, StoredFailure):
            row = (key, canonical_json(request), outcome.kind, outcome.message)
            self._db.execute("INSERT INTO failures VALUES (?, ?, ?, ?)", row)
        else:
            self._db.execute(
                "INSERT INTO exchanges VALUES (?, ?, ?)", (key, canonical_json(request), canonical_json(outcome))
            )

    def requests(self) -> Iterator[JsonObject]:
        """Yield all requests in order of key, with hashes in place of images."""
        with self._reading():
            rows = self._db.execute("SELECT request FROM exchanges ORDER BY key").fetchall()
        for (text,) in rows:
            yield json.loads(text)
