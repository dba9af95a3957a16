"""Keep a thread, and a process that works while the thread waits, on one core (Linux).

The scheduler wakes a process on an idle core if there is one. Two processes that take turns would use two cores, and
each would fetch what both use, such as the images of an observation, from the caches of the other's core.
"""

import ctypes
import os
from collections.abc import Set as AbstractSet
from contextlib import suppress
from typing import Any

_LIBC: Any = ctypes.CDLL(None) if hasattr(os, "sched_setaffinity") else None
IS_SUPPORTED = hasattr(_LIBC, "sched_getcpu")


class OneCore:
    """Binds a thread to one of its cores for a while.

    A bound thread that is woken does not interrupt the one that wakes it, which is about to wait (`SCHED_BATCH`).
    Interrupted, that one would be ready to run on the same core, and the system would move one of the two.
    """

    def __init__(self) -> None:
        self._cores: AbstractSet[int] = frozenset()
        self._is_patient = False

    def remember(self) -> None:
        """Note on which cores this thread may run."""
        if IS_SUPPORTED:
            with suppress(OSError):
                self._cores = os.sched_getaffinity(0)

    def stay(self, pid: int | None = None) -> None:
        """Bind this thread to the core on which it runs, until `release`.

        Args:
            pid: Number of a process that waits for this thread; its main thread is bound to the same core.
        """
        self.remember()
        if len(self._cores) > 1 and (core := int(_LIBC.sched_getcpu())) in self._cores:
            with suppress(OSError):  # the process has ended, or the system does not allow it
                os.sched_setaffinity(0, {core})
                if os.sched_getscheduler(0) == os.SCHED_OTHER:
                    os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))
                    self._is_patient = True
                if pid is not None:
                    os.sched_setaffinity(pid, {core})

    def release(self) -> bool:
        """Let this thread run on the cores that were noted; return whether it was bound since, by whichever process."""
        if self._is_patient:
            with suppress(OSError):
                os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
            self._is_patient = False
        if not self._cores or os.sched_getaffinity(0) == self._cores:
            return False
        with suppress(OSError):
            os.sched_setaffinity(0, self._cores)
        return True
