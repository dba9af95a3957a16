"""Exchanges with a model, kept: what was asked and what came back, so that it can be had again without asking.

An exchange is found by its question alone: the SHA-256 of the request as canonical JSON, each image replaced by the
SHA-256 of its pixels. Images are kept once. No key, address or time is kept, so the same exchanges make the same rows.

What came instead of a response (a timeout, a lost connection, a server's error) is kept apart, in `failures`, by who
wants it to happen again in a replay.
"""

import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evonav.decision.vlm.shared_file import SharedFile
from evonav.errors import StoreError

JsonObject = dict[str, Any]

_SCHEMA = """
CREATE TABLE IF NOT EXISTS exchanges (key TEXT PRIMARY KEY, request TEXT NOT NULL, response TEXT NOT NULL) STRICT;
CREATE TABLE IF NOT EXISTS failures (key TEXT PRIMARY KEY, request TEXT NOT NULL, kind TEXT NOT NULL,
    message TEXT NOT NULL) STRICT;
CREATE TABLE IF NOT EXISTS images (name TEXT PRIMARY KEY, png BLOB NOT NULL) STRICT;
"""


def canonical(value: Any) -> str:  # noqa: ANN401
    """JSON with sorted keys and no spaces: one spelling a value."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False)


def image_name(pixels: NDArray[np.uint8]) -> str:
    """Stands for an image in a kept request: `sha256:` and the hash of its shape and values.

    Not of its file, whose bytes depend on who compressed it.

    Args:
        pixels: `(H, W, 3)` RGB.
    """
    height, width = pixels.shape[:2]
    return "sha256:" + hashlib.sha256(f"{width}x{height} RGB\n".encode() + pixels.tobytes()).hexdigest()


def key_of(request: JsonObject) -> str:
    """What an exchange is found by: SHA-256 of a request with names in place of its images."""
    return hashlib.sha256(canonical(request).encode()).hexdigest()


@dataclass(frozen=True, slots=True)
class Failure:
    """What came of a question instead of a response."""

    kind: str
    message: str


class ResponseCache(SharedFile):
    """Exchanges in one SQLite file (WAL); any number of threads and processes may use it."""

    def __init__(self, path: Path | str) -> None:
        """Opens or makes the file.

        Raises:
            StoreError: It cannot be opened or is no such file.
        """
        super().__init__(path, _SCHEMA, "exchanges")

    def __len__(self) -> int:
        """Number of exchanges."""
        with self._reading():
            return int(self._db.execute("SELECT count(*) FROM exchanges").fetchone()[0])

    @property
    def num_failures(self) -> int:
        """Number of questions of which something else came."""
        with self._reading():
            return int(self._db.execute("SELECT count(*) FROM failures").fetchone()[0])

    def get(self, key: str) -> JsonObject | None:
        """The response kept for a key.

        Raises:
            StoreError: The file cannot be read, or the response in it is no JSON object.
        """
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

    def outcome(self, key: str) -> JsonObject | Failure | None:
        """What is kept for a key: the response, or what came instead.

        Raises:
            StoreError: The file cannot be read, or the response in it is no JSON object.
        """
        response = self.get(key)
        if response is not None:
            return response
        with self._reading():
            return self._failure(key)

    def put(self, request: JsonObject, images: Mapping[str, bytes], response: JsonObject) -> str:
        """Keeps an exchange in place of an older one of the same question; all of it or nothing.

        Args:
            request: With names in place of its images.
            images: PNG files by `image_name`.
            response: What came back.

        Returns:
            Its key.

        Raises:
            StoreError: The file cannot be written.
        """
        key = key_of(request)
        with self._writing():
            self._db.execute("DELETE FROM failures WHERE key = ?", (key,))
            self._db.execute("DELETE FROM exchanges WHERE key = ?", (key,))
            self._insert(key, request, images, response)
        return key

    def keep_first(
        self, request: JsonObject, images: Mapping[str, bytes], outcome: JsonObject | Failure
    ) -> JsonObject | Failure:
        """Keeps an outcome unless there is one of the same question, which another process may have got meanwhile.

        Returns:
            What is kept: all who ask the same have the same answer, in this run and in every replay of it.

        Raises:
            StoreError: The file cannot be written.
        """
        key = key_of(request)
        with self._writing():
            row = self._db.execute("SELECT response FROM exchanges WHERE key = ?", (key,)).fetchone()
            there: JsonObject | Failure | None = self._failure(key) if row is None else json.loads(row[0])
            if there is None:
                self._insert(key, request, images, outcome)
        return outcome if there is None else there

    def forget_failures(self) -> int:
        """Drops what came instead of responses, so that it is asked again; the number of them."""
        with self._writing():
            return self._db.execute("DELETE FROM failures").rowcount

    def _failure(self, key: str) -> Failure | None:
        row = self._db.execute("SELECT kind, message FROM failures WHERE key = ?", (key,)).fetchone()
        return None if row is None else Failure(*row)

    def _insert(
        self, key: str, request: JsonObject, images: Mapping[str, bytes], outcome: JsonObject | Failure
    ) -> None:
        self._db.executemany("INSERT OR IGNORE INTO images VALUES (?, ?)", images.items())
        if isinstance(outcome, Failure):
            row = (key, canonical(request), outcome.kind, outcome.message)
            self._db.execute("INSERT INTO failures VALUES (?, ?, ?, ?)", row)
        else:
            self._db.execute("INSERT INTO exchanges VALUES (?, ?, ?)", (key, canonical(request), canonical(outcome)))

    def image(self, name: str) -> bytes | None:
        """An image's PNG file."""
        with self._reading():
            row = self._db.execute("SELECT png FROM images WHERE name = ?", (name,)).fetchone()
        return None if row is None else bytes(row[0])

    def requests(self) -> Iterator[JsonObject]:
        """What was asked, in order of key; images as hashes."""
        with self._reading():
            rows = self._db.execute("SELECT request FROM exchanges ORDER BY key").fetchall()
        for (text,) in rows:
            yield json.loads(text)
