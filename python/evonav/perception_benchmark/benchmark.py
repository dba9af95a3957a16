"""Measure perceptions against the truth: each sees the same views of the same houses, and its percepts are recorded.

One job is one perception on one task. Its record does not depend on other jobs, nor on the number of workers.
"""

import gzip
import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from evonav._core import __version__
from evonav.component import Component
from evonav.errors import InvalidArgumentError
from evonav.evaluation.episode.spec import EpisodeSpec
from evonav.evaluation.run.components import EMBEDDED, Backend
from evonav.parallel.folders import check_same_run, write_atomically, writing
from evonav.perception import Perception, StageScene
from evonav.perception_benchmark.matching import TrueObjects, true_objects
from evonav.perception_benchmark.memory import JudgedMemory
from evonav.perception_benchmark.picture import side_by_side
from evonav.perception_benchmark.records import (
    HEADER_NAME,
    NUM_CHECKPOINTS,
    MemoryState,
    PerceptionHeader,
    TaskRecord,
    complete_tasks,
    read_header,
    record_path,
)
from evonav.perception_benchmark.rows import Matched, Rows, scored_percept
from evonav.perception_benchmark.tour import tour
from evonav.report.measurements import finished
from evonav.sensors.observation import Detections
from evonav.tasks.listing import TaskFile
from evonav.world.pose import Pose
from evonav.world.simulator import Simulator

WORK = "evonav.perception_benchmark.benchmark:make_worker"
TASK_TIMEOUT_S = 3600.0
"""Time without progress after which a task fails; each place of a tour is progress."""
AGENT = "fu"
"""Agent that percepts are for, where that matters: models of `predicted:auto`."""
NUM_PICTURES = 4
"""Tasks that have a picture."""


@dataclass(frozen=True, slots=True)
class PerceptionSpec:
    """A perception with the name under which it is measured."""

    name: str
    component: Component[Perception]


@dataclass(frozen=True, slots=True)
class TourConfig:
    """Settings that decide the views."""

    views_per_room: int = 12
    """Largest number of views in a room, rounded up to whole places."""
    num_houses: int = 2
    """Different houses of a task that are toured, its first stage's first: the memory is carried from one to the next.
    """
    seed: int = 0

    def __post_init__(self) -> None:
        """Check the values.

        Raises:
            InvalidArgumentError: A value is outside its domain.
        """
        for name, value in (("views_per_room", self.views_per_room), ("num_houses", self.num_houses)):
            if value < 1:
                raise InvalidArgumentError(f"{name} = {value}: must be >= 1")


def measure(
    specs: Sequence[PerceptionSpec],
    tasks: Sequence[TaskFile],
    out: Path,
    *,
    config: TourConfig | None = None,
    simulator: Component[Simulator] = EMBEDDED,
    num_workers: int = 1,
    on_progress: Callable[[int, int, str], None] = lambda *_: None,
) -> tuple[list[str], list[tuple[str, str, str]]]:
    """Tour the houses with every perception; called again on the same folder, tour what is missing.

    Args:
        specs: Perceptions; those of earlier commands stay in the folder.
        tasks: Files from `evonav.tasks.listing.task_files`.
        out: Holds `perception.json` and `records/`.
        config: Must be the folder's own if it holds records.
        simulator: The simulator that draws the views.
        num_workers: 0 runs everything in this process.
        on_progress: Called with records there are, records asked for, and the name of the latest.

    Returns:
        Tasks that have a record of every perception of the folder; and perception, task and last line of what went
        wrong.

    Raises:
        InvalidArgumentError: There is no perception or task, or a perception is named twice.
        StoreError: The folder holds another configuration, or cannot be written.
        EngineError: Workers cannot be had.
    """
    config = config or TourConfig()
    perceptions = [spec.name for spec in specs]
    if not specs or not tasks:
        raise InvalidArgumentError(f"no {'task' if specs else 'perception'} to measure")
    if len(set(perceptions)) != len(perceptions):
        raise InvalidArgumentError(f"a perception is named twice: {', '.join(perceptions)}")
    with writing(out):
        header = _begun(specs, tasks, out, config, simulator)
        jobs: list[tuple[PerceptionSpec, TaskFile, bool]] = [
            (spec, task, number < NUM_PICTURES)
            for number, task in enumerate(tasks)
            for spec in specs
            if not record_path(out, spec.name, task.task_id).exists()
        ]
        _claim_models(header, [spec for spec in specs if any(spec is job[0] for job in jobs)], out)
        num_all = len(tasks) * len(specs)
        num_done, failures = num_all - len(jobs), []
        on_progress(num_done, num_all, "")
        settings = json.dumps({"config": asdict(config), **simulator.identity("simulator")})

        def text_of(job: tuple[PerceptionSpec, TaskFile, bool]) -> str:
            spec, task, has_picture = job
            return json.dumps([asdict(spec), str(task.path), task.digest, has_picture])

        ended = finished(WORK, settings, jobs, text_of, num_workers=num_workers, timeout_s=TASK_TIMEOUT_S)
        for (spec, task, _), text, why in ended:
            if text is None:
                failures.append((spec.name, task.task_id, why))
            else:
                data = gzip.compress(text.encode(), compresslevel=6, mtime=0)
                write_atomically(record_path(out, spec.name, task.task_id), data)
            num_done += 1
            on_progress(num_done, num_all, f"{spec.name} {task.task_id}")
        return complete_tasks(out, header), sorted(failures)


def _begun(
    specs: Sequence[PerceptionSpec],
    tasks: Sequence[TaskFile],
    out: Path,
    config: TourConfig,
    simulator: Component[Simulator],
) -> PerceptionHeader:
    """Claim the folder; records of tasks that are others now are dropped."""
    identity = {"evonav": __version__, "tour": asdict(config), **simulator.identity("simulator")}
    there = read_header(out)
    options = {spec.name: {"make": spec.component.path, "options": dict(spec.component.options)} for spec in specs}
    digests = {task.task_id: task.digest for task in tasks}
    if there is not None:
        check_same_run(there.identity, identity, out)
        for name, known in there.options.items():
            check_same_run({name: known}, {name: options.get(name, known)}, out)
        options = {**there.options, **options}
        for task_id, digest in digests.items():
            if there.digests.get(task_id, digest) != digest:
                for name in there.options:
                    record_path(out, name, task_id).unlink(missing_ok=True)
        digests = {**there.digests, **digests}
    return PerceptionHeader(
        identity=identity,
        options=options,
        models={} if there is None else there.models,
        tasks=[task.task_id for task in tasks],
        digests=digests,
    )


def _claim_models(header: PerceptionHeader, specs: Sequence[PerceptionSpec], out: Path) -> None:
    """Record hashes of weights and versions of libraries before the first view, or check that they are the folder's."""
    for spec in specs:
        found = Backend(perception=spec.component).check_perception([AGENT])
        there = header.models.setdefault(spec.name, found)
        check_same_run({spec.name: there}, {spec.name: found}, out)
    write_atomically(out / HEADER_NAME, json.dumps(header.model_dump(), indent=2) + "\n")


def make_worker(settings: str, alive: Callable[[], None]) -> Callable[[str], str]:
    """Return the function from a job to its record, as `evonav.parallel.pool` calls it."""
    values = json.loads(settings)
    config = TourConfig(**values["config"])
    simulators: Component[Simulator] = Component(values["simulator"], values.get("simulator_options", {}))
    simulator = simulators.create()

    def work(text: str) -> str:
        given, path, digest, has_picture = json.loads(text)
        spec = PerceptionSpec(given["name"], Component(**given["component"]))
        case, perception = Backend().tasks.create(Path(path)), spec.component.create()
        record = measure_task(case, perception, simulator, config, name=spec.name, has_picture=has_picture, alive=alive)
        record.digest = digest
        return record.model_dump_json()

    return work


def measure_task(
    case: EpisodeSpec,
    perception: Perception,
    simulator: Simulator,
    config: TourConfig,
    *,
    name: str,
    has_picture: bool = False,
    alive: Callable[[], None] = lambda: None,
) -> TaskRecord:
    """Measure one perception, which was made for it, on the houses of one task; `alive` is called after every place.

    With `has_picture`, the view of the first house that shows the most objects is drawn.

    Raises:
        EvonavError: The simulator, the perception or the object map fails.
    """
    rows, memory = Rows(), JudgedMemory()
    best: tuple[Pose, Any, TrueObjects, Detections, Matched] | None = None
    states: list[MemoryState] = []
    houses = [stage.house_json for stage in case.stages]
    changed = [
        number for number in range(1, len(houses) + 1) if number == 1 or houses[number - 1] != houses[number - 2]
    ]
    stages, num_views, image_px = changed[: config.num_houses], [], 1
    for stage in stages:
        simulator.reset(houses[stage - 1], case.start)
        objects = simulator.objects
        places = tour(case, stage, simulator, views_per_room=config.views_per_room, seed=config.seed)
        goal = case.stages[stage - 1].public
        perception.begin_stage(StageScene(case.task_id, goal, AGENT, config.seed, objects))
        memory.begin_stage(stage, objects)
        if states:
            states.append(memory.state(0.0))
        # The places after which the memory is judged, with the share of the tour that is done there.
        shares = [i / NUM_CHECKPOINTS for i in range(1, NUM_CHECKPOINTS + 1)]
        checkpoints = {max(1, round(share * len(places))): share for share in shares}
        for number, poses in enumerate(places, start=1):
            frames = [simulator.render(pose, rgb=perception.needs_rgb, instances=True) for pose in poses]
            image_px = frames[0].depth_m.size
            for frame, reported, pose in zip(frames, perception.perceive(frames), poses, strict=True):
                truth = true_objects(frame, objects)
                percept = scored_percept(frame, reported)
                matched = rows.add(stage, frame, percept, truth, objects)
                memory.look(frame, percept, truth)
                if has_picture and stage == 1 and (best is None or truth.num_wanted > best[2].num_wanted):
                    best = pose, frame.rgb, truth, percept.detections, matched
            if number in checkpoints:
                states.append(memory.state(checkpoints[number]))
            alive()
        num_views.append(sum(map(len, places)))
    picture = None
    if best is not None:
        pose, rgb = best[:2]
        if rgb is None:
            simulator.reset(houses[0], case.start)
            rgb = simulator.render(pose, rgb=True, instances=False).rgb
        picture = side_by_side(rgb, *best[2:])
    return TaskRecord(
        task_id=case.task_id,
        digest="",
        house=case.house,
        perception=name,
        image_px=image_px,
        stages=stages,
        num_views=num_views,
        truths=rows.truths,
        detections=rows.detections,
        depth=rows.depth,
        pose=rows.pose,
        features=rows.features(perception.text_feature),
        memory=states,
        picture=picture,
    )
