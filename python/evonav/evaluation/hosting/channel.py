"""Connect an agent's process: shared memory for its observations, a log for its output."""

import mmap
import os
import pickle
import tempfile
import threading
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

MAX_LOG_BYTES = 10_000_000
"""Largest log of an episode; further output is dropped, and the log says so."""
_MAX_LINE_BYTES = 65536
_ALIGN = 64


class SharedBlock:
    """Memory that the evaluator writes and another process can read."""

    def __init__(self) -> None:
        """Create an empty block."""
        if hasattr(os, "memfd_create"):
            import fcntl

            self.descriptor = os.memfd_create("evonav", os.MFD_CLOEXEC | os.MFD_ALLOW_SEALING)
            # If a reader made the file shorter, the next write would kill the writer.
            fcntl.fcntl(self.descriptor, fcntl.F_ADD_SEALS, fcntl.F_SEAL_SHRINK | fcntl.F_SEAL_SEAL)
        else:
            with tempfile.TemporaryFile() as file:
                self.descriptor = os.dup(file.fileno())
        self._map: mmap.mmap | None = None

    def write(self, buffers: Sequence[pickle.PickleBuffer]) -> list[tuple[int, int]]:
        """Copy buffers into the shared memory, and return offset and size of each."""
        views = [buffer.raw() for buffer in buffers]
        places, end = [], 0
        for view in views:
            places.append((end, view.nbytes))
            end += -(-view.nbytes // _ALIGN) * _ALIGN
        if end and (self._map is None or len(self._map) < end):
            if self._map is not None:
                self._map.close()
            os.ftruncate(self.descriptor, end)
            self._map = mmap.mmap(self.descriptor, end)
        if self._map is not None:
            with memoryview(self._map) as block:
                for (offset, size), view in zip(places, views, strict=True):
                    block[offset : offset + size] = view
        for buffer, view in zip(buffers, views, strict=True):
            view.release()
            buffer.release()
        return places

    def close(self) -> None:
        """Release the shared memory; the reader keeps its own."""
        if self._map is not None:
            self._map.close()
        os.close(self.descriptor)


class OutputLog:
    """Appends the output of a process to a file, line by line, with a label before each line.

    The process writes to a pipe: a descriptor of the file itself would reveal the run's folder to the agent.
    """

    def __init__(self, path: Path, name: str) -> None:
        """Open a pipe, whose writing end is `descriptor`."""
        self._reader, self.descriptor = os.pipe()
        self._path = path
        self._label = name
        self._left = MAX_LOG_BYTES
        self._thread = threading.Thread(target=self._run, daemon=True)

    def begin(self) -> None:
        """Close this process's copy of `descriptor` once the child has started, and begin to read."""
        os.close(self.descriptor)
        self._thread.start()

    def begin_part(self, label: str) -> None:
        """Set the label of subsequent log lines."""
        if label != self._label:
            self._label = label
            self._left = MAX_LOG_BYTES

    def end(self) -> None:
        """Wait up to a second for the last output; a process that did not start has none."""
        if self._thread.is_alive():
            self._thread.join(timeout=1.0)

    def _run(self) -> None:
        with os.fdopen(self._reader, "rb") as output:
            first = output.readline(_MAX_LINE_BYTES)
            with suppress(OSError):  # no such folder on this machine of a cluster, or a disk that is full
                if first:  # without output there is no file
                    with self._path.open("ab", buffering=0) as file:
                        self._copy(first, output, file)
            while output.read(_MAX_LINE_BYTES):  # the agent must not block on a full pipe
                pass

    def _copy(self, line: bytes, output: BinaryIO, file: BinaryIO) -> None:
        while line:
            label, left = self._label, self._left
            self._left = left - len(line)
            if left > 0:
                file.write(f"{label} | ".encode() + line.rstrip(b"\n") + b"\n")
                if self._left <= 0:
                    file.write(f"{label} | ... more than {MAX_LOG_BYTES} bytes: the rest is dropped\n".encode())
            line = output.readline(_MAX_LINE_BYTES)
