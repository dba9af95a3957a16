"""Record what a stage asks of the core, and ask it again without anything around it."""

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from evonav import _core

KINDS = (_core.EmbeddedSimulator, _core.ObjectMap, _core.OccupancyMap)
"""Classes of the core that keep something: the tape makes them anew. Others are given as they are."""


@dataclass
class Call:
    """A call, or a property that was read."""

    of: int | None
    """Number of an object on the tape; `None` for a name of the core itself."""
    name: str
    given: tuple[tuple[Any, ...], dict[str, Any]] | None
    """Arguments; `None` for a property."""
    made: int | None = None
    """Number of the object that it returns, if the tape keeps it."""


@dataclass
class Tape:
    """All calls in their order."""

    calls: list[Call] = field(default_factory=list)
    objects: list[Any] = field(default_factory=list)
    """Objects of the core that were made while it was recorded."""

    def replay(self, clocked_ms: dict[str, float] | None = None) -> list[Any]:
        """Makes all calls again; returns the objects that they make.

        Args:
            clocked_ms: CPU time of calls by name, to which that of calls of these names is added.
        """
        objects: list[Any] = []
        clocked_ms = clocked_ms or {}
        for call in self.calls:
            began_s = time.process_time() if call.name in clocked_ms else 0.0
            found = getattr(_core if call.of is None else objects[call.of], call.name)
            if call.given is not None:
                found = found(*call.given[0], **call.given[1])
            if call.made is not None:
                objects.append(found)
            if call.name in clocked_ms:
                clocked_ms[call.name] += 1e3 * (time.process_time() - began_s)
        return objects

    def check(self) -> None:
        """Checks that object maps end with the entries that they had."""
        for was, made in zip(self.objects, self.replay(), strict=True):
            if isinstance(was, _core.ObjectMap) and [e.num_points for e in was.entries] != [
                e.num_points for e in made.entries
            ]:
                raise AssertionError("the same calls made another object map")

    def ask(self, of: int | None, name: str, /, *arguments: object, **keywords: object) -> Any:  # noqa: ANN401
        """Makes a call, and records it."""
        found = getattr(_core if of is None else self.objects[of], name)(*arguments, **keywords)
        call = Call(of, name, (arguments, keywords))
        self.calls.append(call)
        if not isinstance(found, KINDS):
            return found
        call.made = len(self.objects)
        self.objects.append(found)
        return _Recorded(self, call.made)

    def read(self, of: int | None, name: str) -> Any:  # noqa: ANN401
        """Returns what records the calls of a name, or the value of a property."""
        found = getattr(_core if of is None else self.objects[of], name)
        if found in KINDS if isinstance(found, type) else callable(found):
            return partial(self.ask, of, name)
        if of is not None:
            self.calls.append(Call(of, name, None))
        return found


class _Recorded:
    """Stands in for the core, or for an object of it."""

    def __init__(self, tape: Tape, number: int | None) -> None:
        self._tape, self._number = tape, number

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401
        return self._tape.read(self._number, name)

    def __len__(self) -> int:
        return int(self._tape.ask(self._number, "__len__"))


@contextmanager
def recording() -> Iterator[Tape]:
    """Records the calls of all modules that have been imported."""
    tape = Tape()
    users = [one for one in sys.modules.values() if getattr(one, "_core", None) is _core and one.__name__ != "evonav"]
    users = [one for one in users if one.__name__.startswith("evonav.")]
    for module in users:
        module._core = _Recorded(tape, None)
    try:
        yield tape
    finally:
        for module in users:
            module._core = _core
