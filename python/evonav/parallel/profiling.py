"""Sample where the processes of a run spend their CPU time.

A signal comes after every few milliseconds of the process's CPU time, and the time since the last one counts for the
main thread's stack. Compiled code and its threads count for the Python function that called it, since Python handles a
signal when the call has returned. Waiting counts for nothing.
"""

import json
import os
import signal
import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import CodeType, FrameType

from evonav.errors import StoreError
from evonav.parallel.folders import write_atomically

VARIABLE = "EVONAV_PROFILE"
"""Environment variable with the folder for samples; processes without it are not sampled."""
IS_SUPPORTED = hasattr(signal, "setitimer")
"""True where processes can be sampled: not on Windows."""
INTERVAL_S = 0.005
"""CPU time between two samples."""
WRITE_EVERY_S = 5.0
"""Time between two writes of a process's samples, so that little is lost of a process that is killed."""
SINCE_LAST_SAMPLE = "(since the last sample)"
"""Name of the function that stands for a process's CPU time after its last sample, or for all of it if none came.

The system's clock may miss every one of a process's short bursts of work.
"""

_own: "_Sampler | None" = None


@dataclass(frozen=True, slots=True)
class StackFrame:
    """A function."""

    name: str
    file: str
    line: int
    """Line of its definition."""


@dataclass(slots=True)
class Samples:
    """CPU time by stack, of all processes of one name."""

    name: str
    cpu_s: dict[tuple[StackFrame, ...], float] = field(default_factory=lambda: defaultdict(float))
    """CPU seconds by stack, the outermost function first."""

    @property
    def total_s(self) -> float:
        """CPU seconds of all stacks."""
        return sum(self.cpu_s.values())

    def own_s(self) -> dict[StackFrame, float]:
        """Return the CPU seconds of each function without those that it called."""
        own: defaultdict[StackFrame, float] = defaultdict(float)
        for stack, seconds in self.cpu_s.items():
            own[stack[-1]] += seconds
        return dict(own)


@contextmanager
def sampled(name: str) -> Iterator[None]:
    """Sample this process while the block runs, if the environment asks for it.

    Args:
        name: Kind of process; samples of processes of one name are added.
    """
    global _own
    folder = os.environ.get(VARIABLE)
    if not folder or not IS_SUPPORTED or _own is not None:
        yield
        return
    _own = _Sampler(name, Path(folder))
    _own.start()
    try:
        yield
    finally:
        _own.stop()
        _own = None


def rename(name: str) -> None:
    """Set the name under which this process is sampled, if it is."""
    if _own is not None:
        _own.name = name


def save() -> None:
    """Write the samples of this process so far, if it is sampled."""
    if _own is not None:
        _own.save()


class _Sampler:
    def __init__(self, name: str, folder: Path) -> None:
        self.name = name
        self._folder = folder
        self._cpu_s: defaultdict[tuple[CodeType, ...], float] = defaultdict(float)

    def start(self) -> None:
        self._last_s = time.process_time()
        self._written_s = time.monotonic()
        self._before = signal.signal(signal.SIGPROF, self._take)
        signal.siginterrupt(signal.SIGPROF, False)
        signal.setitimer(signal.ITIMER_PROF, INTERVAL_S, INTERVAL_S)

    def stop(self) -> None:
        """Write the samples."""
        try:
            self._stop()
        except SystemExit:  # the parent's signal came in the middle of it
            self._stop()
            raise

    def _stop(self) -> None:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, self._before)
        self.save()

    def _take(self, _: int, frame: FrameType | None) -> None:
        codes = []
        while frame is not None:
            codes.append(frame.f_code)
            frame = frame.f_back
        now_s = time.process_time()
        self._cpu_s[tuple(reversed(codes))] += now_s - self._last_s
        self._last_s = now_s
        if time.monotonic() - self._written_s >= WRITE_EVERY_S:
            self.save()
            self._last_s = time.process_time()

    def save(self) -> None:
        """Write the samples so far."""
        self._written_s = time.monotonic()  # first: while samples are written, others come
        frames: dict[CodeType, int] = {}
        stacks = [
            {"frames": [frames.setdefault(code, len(frames)) for code in stack], "cpu_s": seconds}
            for stack, seconds in list(self._cpu_s.items())  # which a signal may add to
        ]
        functions = [[_name_of(code), code.co_filename, code.co_firstlineno] for code in frames]
        if (rest_s := time.process_time() - self._last_s) > 0.0:
            stacks.append({"frames": [len(functions)], "cpu_s": rest_s})
            functions.append([SINCE_LAST_SAMPLE, "", 0])
        content = {"name": self.name, "functions": functions, "stacks": stacks}
        write_atomically(self._folder / f"{os.getpid()}.json", json.dumps(content))


def _name_of(code: CodeType) -> str:
    return getattr(code, "co_qualname", code.co_name)  # Python 3.11 has the class, too


def read_samples(folder: Path) -> list[Samples]:
    """Return the samples of all processes, by name.

    Raises:
        StoreError: A file is no file of samples.
    """
    by_name: dict[str, Samples] = {}
    for path in sorted(folder.glob("*.json")):
        try:
            content = json.loads(path.read_bytes())
            functions = [StackFrame(name, file, line) for name, file, line in content["functions"]]
            samples = by_name.setdefault(content["name"], Samples(content["name"]))
            for stack in content["stacks"]:
                samples.cpu_s[tuple(functions[index] for index in stack["frames"])] += float(stack["cpu_s"])
        except (OSError, ValueError, TypeError, KeyError, IndexError) as error:
            raise StoreError(f"{path}: no samples of a profile ({error})") from error
    return [by_name[name] for name in sorted(by_name)]
