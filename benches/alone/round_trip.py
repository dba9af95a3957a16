"""Two bare processes that take turns on one core, as an agent's process and its evaluator do."""

import mmap
import os
import socket
import struct
import time
from dataclasses import dataclass
from types import TracebackType

import numpy as np

from evonav.speed_benchmark.timing import one_core

_HEADER = struct.Struct("<QQ")
_MAPPED_BYTES = 1 << 26


@dataclass(frozen=True)
class Round:
    """What a round of an agent moves between the processes."""

    array_bytes: int
    """Arrays of the observation, in shared memory."""
    request_bytes: int
    answer_bytes: int


class BarePair:
    """This process and a fork of it, which answers by so many bytes as it is told."""

    def __init__(self) -> None:
        """Fork; do so before there are threads."""
        self._memory = mmap.mmap(-1, _MAPPED_BYTES)
        self._near, far = socket.socketpair()
        self._pid = os.fork()
        if self._pid == 0:
            try:
                self._near.close()
                _answer(far)
            finally:
                os._exit(0)
        far.close()
        self._answers = self._near.makefile("rb")

    def __enter__(self) -> "BarePair":
        """Return itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """End the fork."""
        self._answers.close()
        self._near.close()
        os.waitpid(self._pid, 0)

    def round_ms(self, size: Round, num_rounds: int, *, copies: bool) -> float:
        """Return the CPU time of a round in both processes, in milliseconds.

        Args:
            size: The bytes of a round.
            num_rounds: Number of rounds, after one that is left out.
            copies: Whether the arrays are copied into memory that both share.
        """
        images, request = np.ones(size.array_bytes, np.uint8), bytes(size.request_bytes)
        shared = np.frombuffer(self._memory, np.uint8, size.array_bytes)
        header = _HEADER.pack(len(request), size.answer_bytes)
        with one_core():
            os.sched_setaffinity(self._pid, os.sched_getaffinity(0))
            for number in range(num_rounds + 1):
                if copies:
                    shared[:] = images
                self._near.sendall(header + request)
                answer_bytes, there_ns = _HEADER.unpack(self._answers.read(_HEADER.size))
                self._answers.read(answer_bytes)
                if number == 0:
                    began_ns = time.process_time_ns() + there_ns
        return (time.process_time_ns() + there_ns - began_ns) / num_rounds / 1e6


def _answer(connection: socket.socket) -> None:
    """Be the fork, until the other process closes the connection."""
    requests = connection.makefile("rb")
    while header := requests.read(_HEADER.size):
        request_bytes, answer_bytes = _HEADER.unpack(header)
        requests.read(request_bytes)
        connection.sendall(_HEADER.pack(answer_bytes, time.process_time_ns()) + bytes(answer_bytes))
