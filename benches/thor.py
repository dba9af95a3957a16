"""AI2-THOR's client on our engine: what a step and a start cost, and how much of that is the client's own."""

import json
import os
import pickle
import statistics
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ai2thor.controller import Controller

import evonav.thor
from benches import canned_engine
from evonav.house import bundled_houses
from evonav.speed_benchmark.timing import Row, rows_of
from evonav.thor.engine import Engine
from evonav.thor.events import Emitter

NOTES = """\
Steps of the unmodified `ai2thor` 5.0.0 `Controller`, 300x300, bundled houses; CPU time of client and engine. The
peer answers every action with the same bytes: its time is that of the client and the pipes.
"""
_IMAGES = {
    "RGB": {},
    "RGB + depth + instances": {"renderDepthImage": True, "renderInstanceSegmentation": True},
}
_NUM_STEPS = 120
_ROUNDS = 5
_NUM_STARTS = 5
_SIZES = (60, 120, 240)
"""Objects of the houses, about."""

House = dict[str, Any]


def run() -> list[Row]:
    """Times steps in houses of three sizes, and the start."""
    houses = [json.loads(house.to_json()) for house in bundled_houses(60)]
    chosen = [min(houses, key=lambda house: abs(_num_objects(house) - size)) for size in _SIZES]
    with tempfile.TemporaryDirectory() as folder:
        rows = [_steps(Path(folder), house, name) for house in chosen for name in _IMAGES]
        return [*rows, _start(Path(folder), chosen[1])]


def _num_objects(house: House) -> int:
    return sum(1 + len(entry.get("children") or ()) for entry in house["objects"])


def _steps(folder: Path, house: House, name: str) -> Row:
    canned = _canned(folder, house, _IMAGES[name])
    with _started(evonav.thor.executable(), house, name) as ours, _started(canned, house, name) as floor:
        num_objects = len(ours.last_event.metadata["objects"])
        pairs = [(_step_ms(ours), _step_ms(floor)) for _ in range(_ROUNDS + 1)][1:]
    steps_per_s = 1e3 / statistics.median(ours_ms for ours_ms, _ in pairs)
    return _row(f"step, {name}, {num_objects} objects ({steps_per_s:.0f} steps/s)", pairs)


def _row(operation: str, pairs: list[tuple[float, float]]) -> Row:
    ours_ms, floor_ms = zip(*pairs, strict=True)
    (row,) = rows_of(operation, ours_ms, {"the same bytes again": floor_ms}, ["bundled"] * len(pairs))
    return row


def _step_ms(controller: Controller) -> float:
    """CPU time of both processes per step."""
    engine = Path(f"/proc/{controller.server.unity_proc.pid}/schedstat")
    before_ns = time.process_time_ns() + int(engine.read_text().split()[0])
    for number in range(_NUM_STEPS):
        if number % 3:
            controller.step("RotateRight", degrees=30)
        else:
            controller.step("MoveAhead")
    return (time.process_time_ns() + int(engine.read_text().split()[0]) - before_ns) / 1e6 / _NUM_STEPS


def _start(folder: Path, house: House) -> Row:
    canned = _canned(folder, house, {})
    pairs = [(_start_ms(evonav.thor.executable(), house), _start_ms(canned, house)) for _ in range(_NUM_STARTS)]
    return _row("start", pairs)


def _start_ms(executable: str, house: House) -> float:
    begin_s = time.monotonic()
    with _started(executable, house, "RGB"):
        return 1e3 * (time.monotonic() - begin_s)


@contextmanager
def _started(executable: str, house: House, name: str) -> Iterator[Controller]:
    settings = _IMAGES[name] | {"snapToGrid": False, "rotateStepDegrees": 30}
    controller = Controller(local_executable_path=executable, x_display="0", scene=house, **settings)
    try:
        controller.step("TeleportFull", **house["metadata"]["agent"])
        yield controller
    finally:
        controller.stop()


def _canned(folder: Path, house: House, settings: House) -> str:
    """The floor's command: an answer of our engine, told again and again."""
    engine = Engine()
    emitter = Emitter(engine)
    for message in (
        {"action": "Initialize", **settings},
        {"action": "CreateHouse", "house": house},
        {"action": "TeleportFull", **house["metadata"]["agent"]},
    ):
        engine.execute(message)
        (_, metadata), *images = emitter.event(message)
    head, key, tail = bytes(metadata).rpartition(b"\xaasequenceId")
    # The id itself is the number after its key; it is told as five bytes there.
    tail = tail[tail.index(b"\xadactiveAgentId") :]
    fields = b"".join(canned_engine.HEADER.pack(kind, body.nbytes) + body.tobytes() for kind, body in images)
    answer = folder / "answer"
    answer.write_bytes(pickle.dumps((head + key, tail, fields)))
    command = folder / "canned"
    command.write_text(f"#!/bin/sh\nexec {sys.executable} {canned_engine.__file__} {answer}\n")
    os.chmod(command, 0o755)  # noqa: PTH101
    return str(command)
