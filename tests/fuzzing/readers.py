"""Fuzz readers that take one text: they return a value, or raise their own error in a few words."""

import gzip
import hashlib
import json
import random
import shutil
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mutation import json_bytes, mutated_bytes, mutated_json

from evonav.agents.agent import EntryBelief, NavigateTo, SensorConfig
from evonav.agents.explanation import RoundDiagnostics
from evonav.agents.hosting import wire
from evonav.decision.prompts import Picture, Prompt
from evonav.decision.vlm.client import read_answer, read_response, usage_of
from evonav.decision.vlm.relay import read_request, request_bytes, response_type
from evonav.errors import EvonavError, InvalidArgumentError
from evonav.house import bundled_houses, stream_houses
from evonav.house.asset_sizes import read_asset_sizes
from evonav.sweeps.file import read_sweep
from evonav.tasks import load_task
from evonav.tasks.listing import BUNDLED_TASKS, task_file, task_roots
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.pose import Pose

EXAMPLES = Path(__file__).parents[2] / "examples" / "sweeps"
MAX_MESSAGE = 30_000
"""Longest error, in characters."""


def is_json(text: bytes) -> bool:
    """Whether a text is one JSON value."""
    try:
        json.loads(text)
    except ValueError:
        return False
    return True


@dataclass(frozen=True)
class Reader:
    """A reader and texts that it reads."""

    seeds: Sequence[bytes]
    read: Callable[[bytes], object]
    errors: tuple[type[Exception], ...] = (EvonavError,)

    def case(self, draws: random.Random) -> bytes:
        """Return a mutated text."""
        seed = draws.choice(self.seeds)
        if draws.random() < 0.5 and is_json(seed):
            return json_bytes(mutated_json(json.loads(seed), draws))
        return mutated_bytes(seed, draws)

    def run(self, data: bytes) -> str:
        """Read a text."""
        try:
            self.read(data)
        except self.errors as error:
            name, length = type(error).__name__, len(str(error))
        else:
            return "read"
        assert 0 < length < MAX_MESSAGE, f"an error of {length} characters"
        return name


def houses(_folder: Path) -> Reader:
    """Return the reader of houses, which are built and looked at."""
    simulator = EmbeddedSimulator()

    def read(data: bytes) -> None:
        pose = simulator.reset(data.decode(errors="replace"), Pose(0.0, 0.9, 0.0, 0.0))
        simulator.render(pose, rgb=False, instances=True)
        simulator.reachable_positions()

    return Reader([house.to_json().encode() for house in bundled_houses(2)], read)


def house_files(folder: Path) -> Reader:
    """Return the reader of files of houses and of sizes of assets, plain or compressed by the first byte."""
    houses = [json.loads(house.to_json()) for house in bundled_houses(2)]
    small = [{**house, "objects": house["objects"][:2]} for house in houses]
    size = {"Cup_1": {"category": "Cup", "size_m": [0.1, 0.1, 0.1]}}
    seeds = [b"\n".join(map(json_bytes, small)), json_bytes(small), json_bytes(small[0]), json_bytes(size)]

    def read(data: bytes) -> None:
        kind, content = data[0] % 4, data[1:]
        path = folder / ("houses.json", "houses.jsonl", "houses.json.gz", "houses.jsonl.gz")[kind]
        path.write_bytes(content)
        try:
            read_asset_sizes(path)
        except EvonavError:
            list(stream_houses(path))

    class HouseFiles(Reader):
        def case(self, draws: random.Random) -> bytes:
            kind, content = draws.randrange(4), Reader([draws.choice(seeds)], read).case(draws)
            if kind >= 2:
                content = gzip.compress(content, 1, mtime=0)
                content = mutated_bytes(content, draws) if draws.random() < 0.3 else content
            return bytes([kind]) + content

    return HouseFiles([], read)


def tasks(folder: Path) -> Reader:
    """Return the reader of tasks; a text is the file's number, whether its checksum is right, and its contents."""
    root = folder / "tasks" / "task"
    shutil.copytree(task_roots(BUNDLED_TASKS)[0], root)
    honest = {str(path.relative_to(root)): path.read_bytes() for path in root.rglob("*") if path.is_file()}
    names = sorted(name for name in honest if not name.endswith(".png"))
    task_id = json.loads(honest["task.json"])["task_id"]
    root = root.rename(root.with_name(task_id))

    def plain(name: str) -> bytes:
        return gzip.decompress(honest[name]) if name.endswith(".gz") else honest[name]

    def read(data: bytes) -> None:
        number, is_consistent, content = data[0], data[1], data[2:]
        changed = {names[number]: gzip.compress(content, 1) if names[number].endswith(".gz") else content}
        if is_consistent and names[number] != "task.json":
            header = json.loads(honest["task.json"])
            header["checksums"][names[number]] = hashlib.sha256(content).hexdigest()
            changed["task.json"] = json_bytes(header)
        for name, one in changed.items():
            (root / name).write_bytes(one)
        try:
            task_file(root)
            load_task(root)
        finally:
            for name in changed:
                (root / name).write_bytes(honest[name])

    class Tasks(Reader):
        def case(self, draws: random.Random) -> bytes:
            number = draws.randrange(len(names))
            return bytes([number, draws.randrange(2)]) + Reader([plain(names[number])], read).case(draws)

    return Tasks([], read)


def sweeps(folder: Path) -> Reader:
    """Return the reader of sweep files."""
    path = folder / "sweep.toml"

    def read(data: bytes) -> None:
        path.write_bytes(data)
        read_sweep(path)

    seeds = [example.read_bytes() for example in sorted(EXAMPLES.glob("*.toml"))]
    return Reader(seeds, read)


def messages(_folder: Path) -> Reader:
    """Return the reader of all that agents' processes send; the first byte says of what kind a message is."""
    entry = EntryBelief(7, "mug", (1.0, 0.5, 2.0), (0.1, 0.1, 0.1), 3)
    readers: list[tuple[bytes, Callable[[bytes], object]]] = [
        (wire.write_action(NavigateTo((1.0, 2.0), (3.0, 4.0))), wire.read_action),
        (wire.SENSORS.write(SensorConfig()), wire.SENSORS.read),
        (
            wire.DIAGNOSTICS.write(RoundDiagnostics("object 7", entry, 1, 2, {"decisions": 1}, {"map": [[1, 2]]})),
            wire.DIAGNOSTICS.read,
        ),
        (wire.ENTRIES.write([entry, entry]), wire.ENTRIES.read),
        (wire.COSTS.write({"num_questions": 3, "cost_usd": 0.1}), wire.COSTS.read),
        (wire.FAILURE.write(wire.Failure("agent", "it broke", "Traceback")), wire.FAILURE.read),
        (wire.write_answer(3, 0.5, 1, {"action": b"{}", "entries": b"[]"}), lambda text: wire.read_answer(text, 3)),
    ]

    class Messages(Reader):
        def case(self, draws: random.Random) -> bytes:
            number = draws.randrange(len(readers))
            return bytes([number]) + Reader([readers[number][0]], self.read).case(draws)

    return Messages([], lambda data: readers[data[0]][1](data[1:]), (InvalidArgumentError,))


def responses(_folder: Path) -> Reader:
    """Return the reader of responses of models' servers, and of what is asked and answered over a relay."""
    choice = {
        "index": 0,
        "message": {"role": "assistant", "content": "object 1", "refusal": None},
        "finish_reason": "stop",
    }
    usage = {"prompt_tokens": 1000, "completion_tokens": 100, "total_tokens": 1100}
    image = Picture(np.zeros((2, 3, 3), np.uint8))
    request, line_end, pixels = request_bytes([Prompt.of("hi", image), Prompt.of(image)], 0, 0).partition(b"\n")
    whole = {"id": "1", "object": "chat.completion", "model": "m", "choices": [choice], "usage": usage}

    def read(data: bytes) -> None:
        with suppress(InvalidArgumentError):
            read_request(data + line_end + pixels)
        with suppress(ValueError):
            response_type().validate_json(data, strict=True)
        response = read_response(data.decode(errors="replace"))
        usage_of(response)
        read_answer(response)

    return Reader([json_bytes(whole), request], read)
