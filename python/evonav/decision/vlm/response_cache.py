"""Cache exchanges with a model, requests and responses, so that a question is answered again without asking.

An exchange is found by its question alone: the SHA-256 of the request as canonical JSON, each image replaced by the
SHA-256 of its pixels. Images are stored once. No key, address or time is stored, so equal exchanges make equal rows.

A client may also store failures (timeouts, lost connections, a server's errors), in a table of their own, so that they
happen again in a replay.
"""

import hashlib
import json
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, WebPImagePlugin  # noqa: F401 - or Pillow imports all its plug-ins for the first WebP

from evonav.decision.pictures import Picture
from evonav.decision.vlm.errors import VlmError
from evonav.decision.vlm.shared_file import SharedFile

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

    def outcome(self, key: str) -> JsonObject | VlmError | None:
        """Return the response or failure stored for a key; `StoreError` if the file or the response is damaged."""
        with self._reading():
            return self._outcome(key)

    def store(
        self,
        request: JsonObject,
        pictures: Sequence[Picture],
        outcome: JsonObject | VlmError,
        *,
        replaces: bool = False,
    ) -> JsonObject | VlmError:
        """Store an outcome in one transaction, unless another process has stored one of the same question meanwhile.

        Args:
            request: The request, with names in place of its images.
            replaces: Store it in place of an older outcome.

        Returns:
            The stored outcome: all who ask the same get the same answer, in this run and in every replay of it.

        Raises:
            StoreError: The file cannot be written.
        """
        key = key_of(request)
        files = self._new_files(pictures)
        with self._writing():
            if replaces:
                self._db.execute("DELETE FROM failures WHERE key = ?", (key,))
                self._db.execute("DELETE FROM exchanges WHERE key = ?", (key,))
            elif (there := self._outcome(key)) is not None:
                return there
            self._db.executemany("INSERT OR IGNORE INTO pictures VALUES (?, ?)", files.items())
            if isinstance(outcome, VlmError):
                row = (key, canonical_json(request), outcome.kind, outcome.message)
                self._db.execute("INSERT INTO failures VALUES (?, ?, ?, ?)", row)
            else:
                texts = (canonical_json(request), canonical_json(outcome))
                self._db.execute("INSERT INTO exchanges VALUES (?, ?, ?)", (key, *texts))
        return outcome

    def _outcome(self, key: str) -> JsonObject | VlmError | None:
        row = self._db.execute("SELECT response FROM exchanges WHERE key = ?", (key,)).fetchone()
        if row is None:
            failure = self._db.execute("SELECT kind, message FROM failures WHERE key = ?", (key,)).fetchone()
            return None if failure is None else VlmError(*failure)
        response = json.loads(row[0])
        if not isinstance(response, dict):
            raise ValueError(f"response of {key}: expected an object, got {str(row[0])[:80]!r}")
        return response

    def _new_files(self, pictures: Sequence[Picture]) -> dict[str, bytes]:
        """Return the files of images that are not stored yet, by name."""
        by_name = {picture.name: picture for picture in pictures}
        with self._reading():
            query = f"SELECT name FROM pictures WHERE name IN ({','.join('?' * len(by_name))})"  # noqa: S608
            stored = {name for (name,) in self._db.execute(query, tuple(by_name))}
        return {name: _file_of(picture) for name, picture in by_name.items() if name not in stored}
