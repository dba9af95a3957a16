"""Connect an agent's process: shared memory for its observations, a log for its output."""

import mmap
import os
import tempfile
import threading
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from evonav.agents.hosting.shared_slots import NUM_SLOTS, Order, Place, Places

MAX_LOG_BYTES = 10_000_000
"""Largest log of an episode; further output is dropped, and the log says so."""
_MAX_LINE_BYTES = 65536
_ALIGN = 64
_LEAST_SLOT_BYTES = 1 << 22
"""Sizes are powers of two from here on, so that few slots outgrow their place; only what is written takes memory."""


@dataclass(slots=True)
class _Slot:
    begin: int
    map: mmap.mmap
    num_used: int = 0
    """Number of bytes from its beginning on that may take memory."""

    def give_back(self, size: int) -> None:
        """Give back the memory of all but the first bytes, which are read as zeros from now on."""
        size = -(-size // mmap.PAGESIZE) * mmap.PAGESIZE
        if self.num_used > size:
            self.map.madvise(mmap.MADV_REMOVE, size, self.num_used - size)
        self.num_used = size


class SharedBlock:
    """Memory that the evaluator writes and another process can read."""

    def __init__(self, *, saves_memory: bool = False) -> None:
        """Create an empty block; `saves_memory` gives back what a slot's next arrays do not need, slowly (Linux)."""
        self._saves_memory = saves_memory and hasattr(mmap, "MADV_REMOVE")
        if hasattr(os, "memfd_create"):
            import fcntl

            self.descriptor = os.memfd_create("evonav", os.MFD_CLOEXEC | os.MFD_ALLOW_SEALING)
            # If a reader made the file shorter, the next write would kill the writer.
            fcntl.fcntl(self.descriptor, fcntl.F_ADD_SEALS, fcntl.F_SEAL_SHRINK | fcntl.F_SEAL_SEAL)
        else:
            with tempfile.TemporaryFile() as file:
                self.descriptor = os.dup(file.fileno())
        self._slots: list[_Slot | None] = [None] * NUM_SLOTS
        self._end = 0
        self.free = 0
        """Number of the slot that is written next: one of which the reader has no array."""

    def write(self, arrays: Iterable[object]) -> Places:
        """Copy arrays into a slot of the shared memory, and return where they are."""
        places: list[Place] = []
        inside, size = [], 0
        for array in arrays:
            if type(array) is not np.ndarray or array.dtype.kind not in "biuf":
                places.append((array,))
                continue
            order: Order = "F" if array.flags.fnc else "C"
            places.append((array.dtype.str, array.shape, size, order, array.flags.writeable))
            inside.append((array, size, order))
            size += -(-array.nbytes // _ALIGN) * _ALIGN
        if size == 0:
            return self.free, 0, 0, 0, places
        slot = self._slot(size)
        for array, offset, order in inside:
            np.ndarray(array.shape, array.dtype, slot.map, offset, None, order)[...] = array
        if self._saves_memory:
            slot.give_back(size)
        return self.free, slot.begin, slot.begin + len(slot.map), size, places

    def _slot(self, size: int) -> _Slot:
        """Return the slot that is written next, at the end of the file if it is too small where it is."""
        slot = self._slots[self.free]
        if slot is None or len(slot.map) < size:
            if slot is not None:
                if self._saves_memory:
                    slot.give_back(0)
                slot.map.close()
            begin, size = self._end, max(_LEAST_SLOT_BYTES, 1 << (size - 1).bit_length())
            self._end += size
            os.ftruncate(self.descriptor, self._end)
            slot = self._slots[self.free] = _Slot(begin, mmap.mmap(self.descriptor, size, offset=begin))
        return slot

    def close(self) -> None:
        """Release the shared memory; the reader keeps its own."""
        for slot in self._slots:
            if slot is not None:
                slot.map.close()
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
