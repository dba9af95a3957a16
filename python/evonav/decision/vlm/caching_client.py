"""Cache exchanges with a model, requests and responses, and ask through the cache: all clients of models share this.

An exchange is found by its question alone: the SHA-256 of the request as canonical JSON, each image replaced by the
SHA-256 of its pixels. Images are stored once. No key, address or time is stored, so equal exchanges make equal rows.

A client may also store failures (timeouts, lost connections, a server's errors), in a table of their own, so that they
happen again in a replay.
"""

import hashlib
import json
from abc import ABC, abstractmethod
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import Any, Literal

import numpy as np
from PIL import Image, WebPImagePlugin  # noqa: F401 - or Pillow imports all its plug-ins for the first WebP

from evonav.decision.pictures import Picture
from evonav.decision.prompts import Prompt
from evonav.decision.vlm.account import Account
from evonav.decision.vlm.errors import LASTING, VlmError
from evonav.decision.vlm.shared_file import SharedFile
from evonav.errors import InvalidArgumentError

Mode = Literal["live", "record", "replay", "auto"]
"""`live` stores nothing, `record` asks and stores, `replay` never asks, `auto` asks only what is not cached."""
MODES: tuple[Mode, ...] = ("live", "record", "replay", "auto")
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


class CachingClient(ABC):
    """Asks a model, caches its responses, and counts the costs."""

    def __init__(
        self,
        *,
        store: ResponseCache | None = None,
        mode: Mode | None = None,
        account: Account | None = None,
        keeps_failures: bool = True,
        keeps_images: bool = True,
    ) -> None:
        """Create a client; nothing is asked or imported yet.

        Args:
            store: Cache of exchanges; every mode but `live` needs one.
            mode: Default `auto` with a cache, else `live`.
            account: Default: an account without prices or limit.
            keeps_failures: True to cache timeouts, lost connections, servers' errors and broken responses in mode
                `auto`, so that they happen again when a run is resumed or replayed; else they are asked again.
            keeps_images: Store the images' files beside their hashes, for people; replays need none.

        Raises:
            InvalidArgumentError: The mode is unknown, or needs a store.
        """
        self.store = store
        self.mode: Mode = mode or ("live" if store is None else "auto")
        self.account = account or Account()
        self.keeps_failures = keeps_failures
        self.keeps_images = keeps_images
        if self.mode not in MODES:
            raise InvalidArgumentError(f"mode: expected one of {', '.join(MODES)}, got {self.mode!r}")
        if self.mode != "live" and store is None:
            raise InvalidArgumentError(f"mode {self.mode}: needs a file of exchanges")

    def ask(self, prompt: Prompt, attempt: int = 0) -> str:
        """Return the model's answer, or raise as `ask_first` does; another attempt is another request."""
        return self.ask_first((prompt,), attempt)[1]

    def ask_first(self, prompts: Sequence[Prompt], attempt: int = 0, *, otherwise: int = 0) -> tuple[int, str]:
        """Return the answer to the first prompt whose outcome is cached; if none is, ask one of them.

        Args:
            prompts: Prompts that differ in the form of the answer.
            attempt: Number of earlier tries without a valid answer.
            otherwise: Index of the prompt that is asked if none is cached.

        Returns:
            Index of the prompt that was answered, and the answer.

        Raises:
            VlmError: There is no valid answer; `kind` says why.
            StoreError: The exchanges cannot be read or written.
            DecisionError: The model cannot be asked.
        """
        requests = [self.cached_request(prompt, attempt) for prompt in prompts]
        keys = [key_of(request) for request in requests]
        index, outcome = otherwise, None
        if self.store is not None and self.mode in ("replay", "auto"):
            outcomes = ((number, self.store.outcome(key)) for number, key in enumerate(keys))
            index, outcome = next((found for found in outcomes if found[1] is not None), (otherwise, None))
        if outcome is not None:
            self.account.replayed()
        elif self.mode == "replay":
            raise VlmError("not_recorded", f"{self.store and self.store.path} has no exchange {keys[index]}")
        else:
            outcome = self._ask_anew(prompts[index], attempt, requests[index])
        if isinstance(outcome, VlmError):
            raise outcome
        return index, self._read(outcome)

    def _ask_anew(self, prompt: Prompt, attempt: int, cached: JsonObject) -> JsonObject | VlmError:
        """Ask the model, and store the outcome if the mode and `keeps_failures` require it."""
        outcome: JsonObject | VlmError
        try:
            outcome = self._ask_model(prompt, attempt)
        except VlmError as error:
            if not self.keeps_failures or error.kind in LASTING:
                raise
            outcome = error
        if self.store is None or self.mode == "live":
            return outcome
        if (self.mode == "record" or not self.keeps_failures) and self._is_malformed(outcome):
            return outcome
        pictures = prompt.pictures if self.keeps_images else []
        return self.store.store(cached, pictures, outcome, replaces=self.mode == "record")

    def _is_malformed(self, outcome: JsonObject | VlmError) -> bool:
        """Return whether it is no response of a model at all; a refusal or a truncated answer is one."""
        if isinstance(outcome, VlmError):
            return True
        try:
            self._read(outcome)
        except VlmError as error:
            return error.kind == "malformed"
        return False

    def costs(self) -> dict[str, float]:
        """Return what the questions have cost so far."""
        return self.account.costs()

    @property
    def never_asks(self) -> bool:
        """True if only cached answers are returned."""
        return self.mode == "replay"

    def is_cached(self, prompt: Prompt, attempt: int = 0) -> bool:
        """Return whether the outcome of a question is cached, so that nothing is asked."""
        return self.store is not None and self.store.outcome(key_of(self.cached_request(prompt, attempt))) is not None

    def check(self) -> None:  # noqa: B027 - by default there is nothing to check
        """Check before the first question that the model can be asked; ask nothing.

        Raises:
            DecisionError: The model cannot be asked; the message says what to do.
        """

    @abstractmethod
    def cached_request(self, prompt: Prompt, attempt: int = 0) -> JsonObject:
        """Return the content that an exchange's key is computed from, with names of images."""

    @abstractmethod
    def _ask_model(self, prompt: Prompt, attempt: int) -> JsonObject:
        """Ask the model itself."""

    @abstractmethod
    def _read(self, response: JsonObject) -> str:
        """Return the answer in a response."""
