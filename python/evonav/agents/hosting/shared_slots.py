"""Show an agent the arrays of a request where they are, in memory that the evaluator writes and never reads.

The memory has a few slots, one for each request. Arrays belong to the agent, which may keep and change them: a slot is
written again only after the last array in it is gone. With each answer, the agent's process names the slot for the next
request, so one that names a slot in use harms only its own agent.
"""

import ctypes
import mmap
import weakref
from collections.abc import Iterable
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

NUM_SLOTS = 3
"""One is written while an agent keeps what is in another; arrays in the last free one are copied, so it stays free."""
LEAST_BYTES = 1 << 19
"""Least size of requests whose arrays are not copied: small ones that are kept should not keep a slot."""

Place: TypeAlias = tuple[Any, ...]
"""Type, shape, offset, order and writability of an array in a slot; or, alone, a value that is no array of numbers."""
Places: TypeAlias = tuple[int, int, int, int, list[Place]]
"""Number of a slot, its begin and end in the file, the size of what is written in it, and where each array is."""

Order: TypeAlias = Literal["C", "F"]

_MAP_FIXED = 0x10


class SharedSlots:
    """The agent's side of the memory."""

    def __init__(self, descriptor: int) -> None:
        """Read from a file that the evaluator writes."""
        self._slots = [_Slot(descriptor) for _ in range(NUM_SLOTS)]

    @property
    def free(self) -> int:
        """Number of a slot of which the agent has no array."""
        return next(number for number, slot in enumerate(self._slots) if not slot.is_in_use)

    def arrays(self, places: Places) -> list[Any]:
        """Return a request's arrays, which the agent may keep and change."""
        number, begin, end, size, of_arrays = places
        if size == 0:
            return [_value(bytearray(), place) for place in of_arrays]
        slot = self._slots[number]
        slot.move(begin, end)
        if size >= LEAST_BYTES and sum(not one.is_in_use for one in self._slots) > 1:
            return slot.lent(of_arrays)
        return slot.copied(of_arrays)

    def part(self) -> None:
        """Give this process and the child that it is about to fork bytes of their own in the slots that are in use."""
        for slot in self._slots:
            slot.part()


class _Slot:
    """A part of the memory."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._span = (0, 0)
        self._map: mmap.mmap | None = None
        self._bytes: weakref.ref[NDArray[np.uint8]] | None = None
        """All bytes, which the arrays of the last request keep alive."""
        self._parted: NDArray[np.uint8] | None = None
        """The same, if a child of this process may have arrays, too."""

    @property
    def is_in_use(self) -> bool:
        """True if someone has an array in it."""
        return self._bytes is not None and self._bytes() is not None

    def move(self, begin: int, end: int) -> None:
        """Map the bytes of the file, if others are mapped."""
        if (begin, end) != self._span:
            self._map = mmap.mmap(self._descriptor, end - begin, offset=begin)
            self._span = (begin, end)

    def lent(self, places: Iterable[Place]) -> list[Any]:
        """Return arrays, which keep the slot in use."""
        assert self._map is not None
        everything = np.frombuffer(self._map, np.uint8)
        self._bytes = weakref.ref(everything)
        return [_value(everything, place) for place in places]

    def copied(self, places: Iterable[Place]) -> list[Any]:
        """Return arrays in memory of their own."""
        assert self._map is not None
        return [_copy(_value(self._map, place)) for place in places]

    def part(self) -> None:
        """Map the same bytes at the same address, so that writes are seen by this process alone; and use no others."""
        everything = None if self._bytes is None else self._bytes()
        if everything is None or self._map is None or self._parted is not None:
            return
        self._parted = everything
        begin, end = self._span
        address = ctypes.addressof(ctypes.c_char.from_buffer(self._map))
        function = ctypes.CDLL(None, use_errno=True).mmap
        function.restype = ctypes.c_void_p
        function.argtypes = (ctypes.c_void_p, ctypes.c_size_t, *(3 * [ctypes.c_int]), ctypes.c_long)
        how = mmap.MAP_PRIVATE | _MAP_FIXED
        done = function(address, end - begin, mmap.PROT_READ | mmap.PROT_WRITE, how, self._descriptor, begin)
        if done != address:
            raise OSError(ctypes.get_errno(), "mmap")


def _value(buffer: bytearray | mmap.mmap | NDArray[np.uint8], place: Place) -> Any:  # noqa: ANN401 - of any type
    if len(place) == 1:
        return place[0]
    kind, shape, offset, order, is_writable = place
    array: NDArray[Any] = np.ndarray(shape, kind, buffer, offset, None, order)
    if not is_writable:
        array.flags.writeable = False
    return array


def _copy(value: Any) -> Any:  # noqa: ANN401 - of any type
    if not isinstance(value, np.ndarray):
        return value
    copy = value.copy("K")
    copy.flags.writeable = value.flags.writeable
    return copy
