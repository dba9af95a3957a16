"""A version of evonav in processes of its own."""

import json
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

ROOT = Path(__file__).parents[2]
# In a small process between: the greatest memory of a child counts from that of the process that starts it.
_CHILD = """
import json, resource, subprocess, sys, time
began_s = time.monotonic()
done = subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL)
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(json.dumps([time.monotonic() - began_s, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024]))
sys.exit(done.returncode)
"""


@dataclass(frozen=True)
class Used:
    """What a command took, with all processes that it waited for."""

    wall_s: float
    cpu_s: float
    peak_mb: float
    """Peak resident memory of the process that used the most."""


class Version:
    """A checkout with its core built, and the Python that runs it."""

    def __init__(self, folder: Path, inputs: Path, words: dict[str, str], python: str = sys.executable) -> None:
        self.folder, self.inputs, self.words, self.python = folder.resolve(), inputs, words, python
        self.environment = {**os.environ, "PYTHONPATH": f"{self.folder / 'python'}{os.pathsep}{ROOT}"}

    def __enter__(self) -> "Version":
        """Start the process that times operations."""
        command = [self.python, "-m", "benches.versions.probe", str(self.inputs)]
        pipes: dict[str, Any] = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
        self._probe = subprocess.Popen(command, env=self.environment, cwd=ROOT, **pipes)
        imported = Path(self._line()["file"]).resolve()
        if self.folder not in imported.parents:
            raise AssertionError(f"{imported} is not of {self.folder}")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """End it."""
        self._probe.stdin.close()  # type: ignore[union-attr] - a pipe
        self._probe.wait()

    def time(self, operation: tuple[Any, ...], number: int) -> dict[str, float]:
        """CPU and wall time in milliseconds: `cpu_ms`, `wall_ms`."""
        return self._ask(operation, number, is_asked=False)

    def answer(self, operation: tuple[Any, ...], number: int) -> object:
        """What it finds, as far as both versions should find the same."""
        return self._ask(operation, number, is_asked=True)["answer"]

    def command(self, *arguments: str | Path) -> list[str]:
        """An `evonav` command in this version's words: each of `words` is replaced."""
        return [self.python, "-m", "evonav", *(self.words.get(str(one), str(one)) for one in arguments)]

    def run(self, *arguments: str | Path) -> Used:
        """Runs a command to its end."""
        command = [sys.executable, "-c", _CHILD, *self.command(*arguments)]
        done = subprocess.run(command, env=self.environment, capture_output=True, text=True, check=False)
        if done.returncode:
            raise AssertionError(f"{self.folder}: {arguments} gave {done.returncode}: {done.stderr[-2000:]}")
        return Used(*json.loads(done.stdout))

    def _ask(self, operation: tuple[Any, ...], number: int, *, is_asked: bool) -> dict[str, Any]:
        request = {"operation": operation, "number": number, "is_asked": is_asked}
        assert self._probe.stdin is not None  # a pipe
        self._probe.stdin.write(json.dumps(request) + "\n")
        self._probe.stdin.flush()
        return self._line()

    def _line(self) -> dict[str, Any]:
        assert self._probe.stdout is not None  # a pipe
        line = self._probe.stdout.readline()
        if not line:
            raise AssertionError(f"{self.folder}: the process that times operations ended")
        answer: dict[str, Any] = json.loads(line)
        return answer
