"""Check that a memory keeps the contract of `evonav.memory_benchmark.protocol`: eight frames of one mug on a wall."""

from collections.abc import Iterator, Sequence
from contextlib import closing
from itertools import chain, islice

import numpy as np

from evonav.counted import counted
from evonav.evaluation.contract.points import Check, ContractReport
from evonav.memory_benchmark.answers import MemoryFailedError
from evonav.memory_benchmark.local import HostedMemory
from evonav.memory_benchmark.protocol import MemoryFrame, StreamInfo
from evonav.memory_benchmark.records import StreamResult
from evonav.memory_benchmark.run import MeasureSettings, MemorySource, host, measure
from evonav.memory_benchmark.truth import FrameTruth, TrueChange
from evonav.sensors.observation import NO_OCCUPANCY, Detections, View
from evonav.world.pose import Pose
from evonav.world.simulator import Intrinsics, SceneObject

SLOW_FRAME_MS = 500.0
"""Time of a frame from which on the check warns: half of a stream's frames come twice a second."""
_SIDE_PX, _BLOCK_PX, _FOCAL_PX = 60, 8, 30.0
_MUG_M, _WALL_M, _HEIGHT_M = 2.0, 3.0, 1.5
_NUM_FRAMES = 4
_MUG_SIZE_M = _BLOCK_PX / _FOCAL_PX * _MUG_M
_MUG = SceneObject("mug", "Mug", "object", (0.0, _HEIGHT_M, _MUG_M), (_MUG_SIZE_M, _MUG_SIZE_M, 0.1))


def check_memory(memory: MemorySource, *, timeout_s: float = 60.0) -> ContractReport:
    """Run a memory through a tiny stream and check that it keeps the contract; no exception of it is raised.

    The stream shows a mug for four frames, and in a second visit the place where it stood for four more.

    Args:
        memory: `./file.py:Class` or `package.module:Class`, the same with options as a `Component`, or a function that
            makes a memory. A named one runs in a process of its own first, where it can do no harm.
        timeout_s: Time limit of a call in that process.

    Examples:
        >>> import evonav
        >>> from evonav.memory_benchmark.references import NumpyList
        >>> report = evonav.check_memory(NumpyList)
        >>> report.is_ok
        True
        >>> [check.name for check in report.checks if check.verdict == "warn"]
        ['updates']
    """
    name = memory if isinstance(memory, str) else getattr(memory, "path", None) or getattr(memory, "__name__", "memory")
    return ContractReport(str(name), tuple(_checks(memory, MeasureSettings(timeout_s=timeout_s, runs_twice=True))))


def _checks(memory: MemorySource, settings: MeasureSettings) -> Iterator[Check]:
    stream = _TinyStream()
    result = measure(memory, stream, settings)
    if (failure := result.failure) is not None:
        at = "" if failure.frame is None else f" (frame {failure.frame} of the check)"
        yield Check(
            {"load": "importable", "answer": "answers"}.get(failure.kind, "calls"), "fail", failure.message + at
        )
        return
    yield Check("importable", "pass", "it has reset, visit, observe and entries")
    yield Check("calls", "pass", f"{result.num_visits} visits and {result.num_frames} frames without an exception")
    yield from _answers(result)
    with closing(host(memory, settings)) as hosted:
        yield _reset(hosted, stream)
    with closing(host(memory, MeasureSettings(own_process=False))) as hosted:
        yield from _last_points(hosted, _TinyStream())  # whose arrays nobody has had


def _answers(result: StreamResult) -> Iterator[Check]:
    """Check what the memory answered in both runs."""
    update, size, queries = result.update, result.size, result.queries
    assert update is not None
    assert size is not None
    yield Check("entries", "pass", f"{update.entries} at the ends of two visits, all well-formed")
    if not update.seen_remembered:
        finding = "no right entry of a mug that was seen for four frames: centres are (x, y, z) in metres, y is up"
        yield Check("remembers", "warn", finding)
        yield Check("updates", "skip", "there was nothing to remove")
    else:
        yield Check("remembers", "pass", "it has an entry of the mug where it stands")
        seen = "after its empty place was seen for four frames"
        if update.removals_done == update.removals:
            yield Check("updates", "pass", f"the entry is gone {seen}")
        else:
            yield Check("updates", "warn", f"the entry is still there {seen}; the benchmark will count that")
    if queries is None:
        yield Check("locate", "skip", "there is no `locate(text, k)`: nothing is retrieved")
    elif queries["before"].hits_at_5:
        yield Check("locate", "pass", "it finds the mug")
    else:
        yield Check("locate", "warn", "no place that it answers for `Mug` is within 1 m of the mug")
    if size.num_bytes is None:
        yield Check("num_bytes", "skip", "there is no `num_bytes()`: only its process is measured")
    elif result.notes:
        yield Check("num_bytes", "warn", result.notes[0])
    else:
        yield Check("num_bytes", "pass", f"{size.num_bytes} bytes at the end")
    if result.is_deterministic:
        yield Check("determinism", "pass", "two runs gave the same bits")
    else:
        yield Check("determinism", "warn", "two runs gave different entries: seed what is random")


def _reset(memory: HostedMemory, stream: "_TinyStream") -> Check:
    try:
        _show(memory, stream, _NUM_FRAMES)
        memory.reset(stream.info)
        num_left = len(memory.entries())
    except MemoryFailedError as error:
        return Check("reset", "fail", str(error))
    if num_left:
        return Check("reset", "fail", f"{counted(num_left, 'entry')} left after `reset`: it must forget everything")
    return Check("reset", "pass", "no entries are left after `reset`")


def _last_points(memory: HostedMemory, stream: "_TinyStream") -> Iterator[Check]:
    """Check in this process what another one would hide: whether it writes into what it is given."""
    before = [[array.copy() for array in frame.arrays()] for frame, _ in stream.frames()]
    try:
        times_ms = _show(memory, stream, 2 * _NUM_FRAMES)
    except MemoryFailedError as error:
        yield Check("frames", "fail", f"in this process: {error}")
        return
    after = [frame.arrays() for frame, _ in stream.frames()]
    if all(map(np.array_equal, chain(*before), chain(*after))):
        yield Check("frames", "pass", "the arrays that it received are unchanged")
    else:
        yield Check("frames", "warn", "it writes into the arrays that it receives: copy them")
    slowest_ms = max(times_ms)
    finding = f"{np.median(times_ms):.2f} ms a frame of {_SIDE_PX} x {_SIDE_PX} pixels, {slowest_ms:.2f} ms at worst"
    yield Check("time", "warn" if np.median(times_ms) > SLOW_FRAME_MS else "pass", finding)


def _show(memory: HostedMemory, stream: "_TinyStream", num_frames: int) -> list[float]:
    """Show the first frames of the stream, and return the wall time of each in ms."""
    memory.reset(stream.info)
    times_ms, visit = [], 0
    for frame, _ in islice(stream.frames(), num_frames):
        if frame.visit != visit:
            memory.visit(frame.time_s)
            visit = frame.visit
        cost = memory.observe(frame)
        times_ms.append(0.0 if cost is None else cost.wall_s * 1e3)
        memory.entries()
    return times_ms


class _TinyStream:
    """A mug in front of a wall for four frames, and the wall alone for four more."""

    name, kind, house, has_truth = "check/mug/0", "check", "mug", True

    def __init__(self) -> None:
        fov_rad = 2.0 * float(np.arctan(_SIDE_PX / 2.0 / _FOCAL_PX))
        self.info = StreamInfo(Intrinsics(_SIDE_PX, _SIDE_PX, fov_rad), ("Mug",), rate_hz=2.0)
        self.changes: Sequence[TrueChange] = [TrueChange("mug", "Mug", "removed", _NUM_FRAMES, _MUG, None)]
        self._views = [self._view(is_there=index < _NUM_FRAMES) for index in range(2 * _NUM_FRAMES)]

    def frames(self) -> Iterator[tuple[MemoryFrame, FrameTruth]]:
        """Yield the frames; their arrays are the same each time."""
        there, gone = (_MUG,), ()
        for index, view in enumerate(self._views):
            is_there = index < _NUM_FRAMES
            time_s = index / self.info.rate_hz + (0.0 if is_there else 3600.0)
            frame = MemoryFrame(index, time_s, 1 if is_there else 2, view)
            num_px = _BLOCK_PX**2
            if is_there:
                yield frame, FrameTruth(there, {"mug": num_px}, {}, ("mug",))
            else:
                yield frame, FrameTruth(gone, {}, {0: num_px}, ())

    def _view(self, *, is_there: bool) -> View:
        depth_m = np.full((_SIDE_PX, _SIDE_PX), _WALL_M, np.float32)
        masks = np.full((_SIDE_PX, _SIDE_PX), -1, np.int32)
        rgb = np.full((_SIDE_PX, _SIDE_PX, 3), 200, np.uint8)
        if is_there:
            middle = slice((_SIDE_PX - _BLOCK_PX) // 2, (_SIDE_PX + _BLOCK_PX) // 2)
            depth_m[middle, middle], masks[middle, middle], rgb[middle, middle] = _MUG_M, 0, (180, 30, 30)
        labels = ("Mug",) if is_there else ()
        return View(
            pose=Pose(0.0, _HEIGHT_M, 0.0, 0.0, 0.0),
            intrinsics=self.info.intrinsics,
            depth_m=depth_m,
            detections=Detections(masks, labels, np.ones(len(labels), np.float32)),
            occupancy=NO_OCCUPANCY,
            rgb=rgb,
        )
