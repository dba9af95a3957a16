"""Commands: what they write and import, and what they send to a model, without all else."""

import base64
import io
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import Any

from PIL import Image
from pydantic_core import to_json

from benches import waiting
from benches.alone.row import Alone, Figure, in_turn, sums
from evonav.agents.agent import SensorConfig
from evonav.decision.vlm.mock_answers import mock_answer
from evonav.decision.vlm.mock_server import MockServer, serving
from evonav.evaluation.records.store import RunStore
from evonav.generation.worker import GenerationOptions, process_house, put_task
from evonav.house.files import BUNDLED, HouseTexts
from evonav.memory.views import JPEG_QUALITY
from evonav.speed_benchmark.timing import one_core
from evonav.speed_benchmark.views import views_of_houses
from evonav.tasks.manifest import Task
from evonav.tasks.records import sha256_of
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.simulator import SimulatorConfig

NUM_TASKS, TASKS_A_S = 20, 60
NUM_FIRST, FIRST_MS = 5, 1000.0
QUESTIONS_A_S, NUM_CORES, NUM_ENCODED, NUM_DRAWN_HOUSES = 50, 2, 5, 3
VIEWS_A_ROUND = SensorConfig().later_rounds.count
_IMPORTED = """
import evonav.evaluation.run.worker
from evonav.evaluation.run.components import Backend
for part in (Backend().simulator, Backend().perception): part.create()
"""
_IMPORT = """
import contextlib, importlib, sys
for name in sys.argv[1:]:
    with contextlib.suppress(Exception): importlib.import_module(name)
"""


def rows(houses: Path | None) -> Iterator[str]:
    """The rows of generation, of a first evaluation, and of questions to a model."""
    with one_core():
        yield from _generation(houses)
    yield from _first_evaluation()
    yield from _questions()


# Generation


def _generation(houses: Path | None) -> Iterator[str]:
    """A task with everything written; its files alone, and its reference images alone."""
    options = GenerationOptions()
    with tempfile.TemporaryDirectory() as name:
        out = Path(name)

        def whole(text: str) -> list[Task]:
            made: list[Task] = []

            def generate(house: Any) -> dict[Path, Task]:  # noqa: ANN401 - a house of the core
                made.append(options.generate(house))
                return {out: made[-1]}

            process_house(0, "house", text, generate)
            return made

        made = [(text, *whole(text)) for _, text in islice(HouseTexts(houses or BUNDLED), NUM_TASKS)]
        texts, tasks = zip(*(one for one in made if len(one) == 2), strict=True)  # some houses give no task
        simulators: list[EmbeddedSimulator] = []

        def load(number: int) -> None:
            """Loads the houses of a task: each finds its light with its first image, once for equal houses."""
            shutil.rmtree(out)
            out.mkdir()
            simulators.clear()
            for stage in range(1, tasks[number].header.num_stages + 1):
                simulators.append(EmbeddedSimulator(SimulatorConfig(style="default")))
                simulators[-1].reset(tasks[number].house_json(stage), name="house")

        def images(number: int) -> list[Any]:
            poses = [stage.reference_pose.pose() for stage in tasks[number].oracle_stages]
            return [one.render(pose).rgb for one, pose in zip(simulators, poses, strict=True)]

        def files(number: int) -> None:
            put_task(tasks[number], out / "again", "label")
            for content in tasks[number].contents.values():
                sha256_of(content)

        load(0)
        same = [(a == b).all() for a, b in zip(images(0), tasks[0].reference_images, strict=True)]
        if not all(same):
            raise AssertionError("the reference images are others")
        calls = {"task": lambda number: whole(texts[number]), "images": images, "files": files}
        found = in_turn(calls, len(tasks), prepare=load)
    aim_ms = [1000 / TASKS_A_S] * len(tasks)
    work = f"a task of {'bundled' if houses is None else 'hard'} houses, everything written"
    yield from Figure(work, found["task"], f"{TASKS_A_S} a CPU second", aim_ms).rows(
        Alone("packing, writing and checksums of its files", found["files"], "making them"),
        Alone("its reference images, houses loaded", found["images"], "Algorithm 1, changes of houses, paths"),
        Alone("both", sums(found["files"], found["images"]), "the same, instructions, the start of the command"),
    )


# A first evaluation


def _first_evaluation() -> Iterator[str]:
    """The command by the wall clock; what it imports that is not evonav's, and its stages."""
    whole_ms, imports_ms, stages_ms = [], [], []
    with tempfile.TemporaryDirectory() as name:
        arguments = ["-m", "evonav", "evaluate", "--agent", "fu", "--limit", "1", "--workers", "1", "--out"]
        imported = [_imported([*arguments, f"{name}/first"]), _imported(["-c", _IMPORTED])]
        for number in range(NUM_FIRST):
            whole_ms.append(_wall_ms([[*arguments, f"{name}/{number}"]]))
            imports_ms.append(_wall_ms([["-c", _IMPORT, *modules] for modules in imported]))
            with RunStore(Path(name) / str(number)) as store:
                stages_ms.append(1e3 * sum(cpu_s for _, cpu_s in store.timings().values()))
    work = "a first evaluation of one bundled task by `fu`, wall clock"
    yield from Figure(work, whole_ms, f"{FIRST_MS / 1000:.1f} s", [FIRST_MS] * NUM_FIRST).rows(
        Alone("imports of what is not evonav's, in the command and in the worker at once", imports_ms, "all of evonav"),
        Alone("CPU time of its stages", stages_ms, "all starting"),
        Alone("both", sums(imports_ms, stages_ms), "evonav's own modules, the store, the end of processes"),
    )


def _imported(arguments: Sequence[str]) -> list[str]:
    """Names of the modules that a program imports and evonav does not own, in their order."""
    told = _python(["-X", "importtime", *arguments], stderr=subprocess.PIPE).communicate()[1].decode()
    names = [line.rpartition("|")[2].strip() for line in told.splitlines() if line.startswith("import time:")]
    return [name for name in names[1:] if name.partition(".")[0] != "evonav"]


def _wall_ms(programs: Sequence[Sequence[str]]) -> float:
    """Wall milliseconds of programs that are started together."""
    began_s = time.perf_counter()
    processes = [_python(arguments) for arguments in programs]
    for process in processes:
        if process.wait():
            raise AssertionError(f"{process.args} gave {process.returncode}")
    return 1e3 * (time.perf_counter() - began_s)


def _python(arguments: Sequence[str], stderr: int = subprocess.DEVNULL) -> "subprocess.Popen[bytes]":
    return subprocess.Popen([sys.executable, *arguments], stdout=subprocess.DEVNULL, stderr=stderr)


# Questions


def _questions() -> Iterator[str]:
    """The CPU time of a question, with its round; its pictures encoded and its text written alone."""

    def reply(request: dict[str, Any]) -> Mapping[str, Any]:
        return {"text": mock_answer(request)}

    with tempfile.TemporaryDirectory() as name, serving(MockServer(reply)) as server:
        asking = waiting.asking(server.url, Path(name) / "run")
        _wall_ms([["-m", "evonav", *asking, "--limit", "1", "--workers", "1"]])
        with RunStore(Path(name) / "run") as store:
            question_ms = 1e3 * sum(cpu_s for _, cpu_s in store.timings().values()) / server.num_requests
        requests = server.requests or []
    pictures = list(dict.fromkeys(url for request in requests for url in _pictures(request)))
    decoded = [Image.open(io.BytesIO(base64.b64decode(url.partition(",")[2]))).convert("RGB") for url in pictures]

    def encode(_: int) -> None:
        for image in decoded:
            file = io.BytesIO()
            image.save(file, "JPEG", quality=JPEG_QUALITY)
            base64.b64encode(file.getvalue())

    simulators, views = views_of_houses(SimulatorConfig(), NUM_DRAWN_HOUSES)
    calls = {
        "encoded": encode,
        "written": lambda _: [to_json(request) for request in requests],
        "drawn": lambda _: [simulators[view.house].render_camera(view.camera) for view in views],
    }
    with one_core():
        found = in_turn(calls, NUM_ENCODED)
    shares = {"encoded": 1 / len(requests), "written": 1 / len(requests), "drawn": VIEWS_A_ROUND / len(views)}
    parts = {name: [share * one for one in found[name]] for name, share in shares.items()}
    aim_ms = [1000 * NUM_CORES / QUESTIONS_A_S] * NUM_ENCODED
    work = f"a question with {sum(len(_pictures(one)) for one in requests) / len(requests):.0f} pictures, and its round"
    aim = f"{QUESTIONS_A_S} questions a second on {NUM_CORES} cores"
    yield from Figure(work, [question_ms] * NUM_ENCODED, aim, aim_ms).rows(
        Alone(f"{VIEWS_A_ROUND} views of bundled houses drawn with colours", parts["drawn"], "all but drawing"),
        Alone(f"its {len(pictures) / len(requests):.1f} new pictures as JPEG", parts["encoded"], "all else"),
        Alone("its JSON with all pictures", parts["written"], "all else"),
        Alone("all three", sums(*parts.values()), "object map, agents, perception, the way to the model"),
    )


def _pictures(request: dict[str, Any]) -> list[str]:
    """The addresses of a request's pictures, which hold them."""
    contents = [message["content"] for message in request["messages"] if not isinstance(message["content"], str)]
    return [part["image_url"]["url"] for parts in contents for part in parts if part["type"] == "image_url"]
