"""Memories that break the contract, each in one way."""

import os
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from hand_made import entry

from evonav.memory_benchmark.protocol import FoundPlace, MemoryEntry

GOOD = entry(1, 1.0)


class Good:
    """Keeps the contract: one entry, for ever."""

    def reset(self, info: Any) -> None:
        pass

    def visit(self, time_s: float) -> None:
        pass

    def observe(self, frame: Any) -> None:
        pass

    def entries(self) -> Sequence[MemoryEntry]:
        return [GOOD]

    def locate(self, text: str, k: int) -> Sequence[FoundPlace]:
        return [FoundPlace((1.0, 1.0, 0.0), 1.0)]

    def num_bytes(self) -> int:
        return 1000


class Empty(Good):
    """Remembers nothing."""

    def entries(self) -> Sequence[MemoryEntry]:
        return []


class Raises(Good):
    def observe(self, frame: Any) -> None:
        if frame.index == 3:
            raise KeyError("no such voxel")


class Exits(Good):
    def observe(self, frame: Any) -> None:
        raise SystemExit(3)


class Hangs(Good):
    def observe(self, frame: Any) -> None:
        if frame.index == 3:
            time.sleep(600.0)


class Dies(Good):
    def observe(self, frame: Any) -> None:
        if frame.index == 3:
            os._exit(7)


class Answers(Good):
    """Answers whatever it is made with."""

    def __init__(self, **fields: Any) -> None:
        self._entry = replace(GOOD, **fields)

    def entries(self) -> Sequence[MemoryEntry]:
        return [GOOD, self._entry]


class NanBoxes(Answers):
    def __init__(self) -> None:
        super().__init__(entry_id=2, centre_m=(1.0, float("nan"), 0.0))


class Million(Good):
    def entries(self) -> Sequence[MemoryEntry]:
        return [GOOD] * 1_000_000


class LiesAboutBytes(Good):
    def num_bytes(self) -> int:
        return 1


class NegativeBytes(Good):
    def num_bytes(self) -> int:
        return -5


class AnswersNone(Good):
    def entries(self) -> Any:
        return None


class Leaks(Good):
    """Fills 2 MB a frame, and says that it holds a thousand bytes."""

    def __init__(self) -> None:
        self._held: list[bytes] = []

    def observe(self, frame: Any) -> None:
        self._held.append(os.urandom(2_000_000))


class Forgetful(Good):
    """Gives other bits in each run."""

    def entries(self) -> Sequence[MemoryEntry]:
        return [replace(GOOD, confidence=int.from_bytes(os.urandom(2), "big") / 65535)]


class Raising:
    """Cannot be made."""

    def __init__(self) -> None:
        raise OSError("no weights")
