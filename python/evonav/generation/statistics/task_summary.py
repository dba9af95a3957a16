"""Summarise tasks for statistics, without reading their images, later houses and checksums."""

import json
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import ceil, comb, dist
from pathlib import Path

from pydantic import TypeAdapter

from evonav.errors import HouseError, TaskError
from evonav.house import House
from evonav.parallel.pool import Answer, Job, answers, open_pool
from evonav.parallel.worker import Workforce
from evonav.tasks.manifest import PublicStage, TaskHeader
from evonav.tasks.oracle import DuringRecord, Evolution, OracleStage
from evonav.tasks.records import parse_record, read_file, read_gzip

MODES = ("SALIENT_OBJECT", "RETAIN_GROUP", "FULL_SHUFFLE")
RATIO_CLASSES = ("0%", *(f"{10 * i}-{10 * i + 10}%" for i in range(10)))
"""Classes of the ratio of relocated objects; each includes its upper end."""
CHUNK = 16
"""Number of tasks in one job of a worker process."""
CHUNK_TIMEOUT_S = 300.0
"""Longest time for one task of a job."""
WORK = "evonav.generation.statistics.task_summary:make_reader"

_PLAN = re.compile(r'"roomSpecId"\s*:\s*"([^"\\]{1,80})"')


@dataclass(slots=True)
class TaskSummary:
    """The numbers of one task: numerator and denominator of each metric, counts and values."""

    task_id: str
    house_sha256: str
    seed: int
    generator: str
    parameters: str
    """The generation parameters as JSON."""
    num_stages: int
    num_rooms: int
    plan: str | None
    """The house's room plan, `metadata.roomSpecId`."""
    expected_evolutions: tuple[float, ...]
    """Chances of 0, 1, ... evolved transitions under the parameters."""
    expected_modes: tuple[float, float, float]
    sums: dict[str, list[float]] = field(default_factory=dict)
    """Numerator and denominator by metric."""
    counts: dict[str, Counter[str]] = field(default_factory=dict)
    values: dict[str, list[float]] = field(default_factory=dict)

    def add(self, key: str, numerator: float, denominator: float = 1) -> None:
        """Add to a metric."""
        sums = self.sums.setdefault(key, [0.0, 0.0])
        sums[0] += numerator
        sums[1] += denominator

    def count(self, key: str, name: str, times: int = 1) -> None:
        """Count a name of a distribution."""
        self.counts.setdefault(key, Counter())[name] += times

    def add_value(self, key: str, value: float) -> None:
        """Add a value of a quantity."""
        self.values.setdefault(key, []).append(value)


_SUMMARIES = TypeAdapter(list[TaskSummary])


def expected_evolutions(num_stages: Sequence[int], probability: float) -> tuple[float, ...]:
    """Return the chances of 0, 1, ... evolved transitions, with K uniform on `num_stages`."""
    shares = [0.0] * max(num_stages)
    for stages in num_stages:
        for evolved in range(stages):
            chance = comb(stages - 1, evolved) * probability**evolved * (1 - probability) ** (stages - 1 - evolved)
            shares[evolved] += chance / len(num_stages)
    return tuple(shares)


def summary_of(
    header: TaskHeader, oracle: Sequence[OracleStage], public: Sequence[PublicStage], house_json: str
) -> TaskSummary:
    """Summarise a task.

    Args:
        oracle: Oracle parts of the task's stages, in order.
        public: Public parts of the task's stages, in order.

    Raises:
        HouseError: The house is malformed.
    """
    theta = header.parameters
    plan = _PLAN.search(house_json)
    modes = (theta.salient_object_probability, theta.retain_group_probability, theta.full_shuffle_probability)
    total = sum(modes) or 1.0
    summary = TaskSummary(
        task_id=header.task_id,
        house_sha256=header.house.sha256,
        seed=header.seed,
        generator=header.generator,
        parameters=theta.model_dump_json(),
        num_stages=header.num_stages,
        num_rooms=header.house.num_rooms,
        plan=None if plan is None else plan.group(1),
        expected_evolutions=expected_evolutions(theta.num_stages, theta.evolve_probability),
        expected_modes=(modes[0] / total, modes[1] / total, modes[2] / total),
    )
    house = House(house_json, name=header.house.name)
    room_types = {room.id: room.room_type for room in house.rooms}
    objects_by_room = Counter(entry.room_id for entry in house.objects)
    _add_task(summary, header, oracle, house)
    previous: Evolution | None = None
    earlier: set[str] = set()
    for stage in oracle:
        _add_goal(summary, stage, room_types, earlier)
        earlier.add(stage.target.id)
        if theta.extensions.during_stage is not None:
            _add_during(summary, stage.during)
        if stage.stage > 1:
            _add_transition(summary, stage, previous, objects_by_room)
            previous = stage.evolution
    for one in public:
        for name in ("basic", "appearance", "unified"):
            summary.add_value(f"{name}_words", len(getattr(one, f"{name}_instruction").split()))
    return summary


def _add_task(summary: TaskSummary, header: TaskHeader, oracle: Sequence[OracleStage], house: House) -> None:
    num_evolutions = sum(stage.evolution.outcome == "evolved" for stage in oracle)
    ratio = len(oracle[-1].ever_relocated_ids) / header.house.num_objects
    summary.add("evolved_once", num_evolutions >= 1)
    summary.add("evolved_twice", num_evolutions >= 2)
    summary.add("num_stages", header.num_stages)
    summary.add("ratio_zero", ratio == 0)
    summary.add("ratio_above_80", ratio > 0.8)
    summary.add_value("relocated_ratio", ratio)
    summary.add_value("task_path_m", sum(stage.reference_path_length_m for stage in oracle))
    summary.add_value("num_rooms", header.house.num_rooms)
    summary.add_value("num_objects", header.house.num_objects)
    summary.count("num_evolutions", str(num_evolutions))
    summary.count("num_stages", str(header.num_stages))
    summary.count("num_rooms", str(header.house.num_rooms))
    summary.count("relocated_ratio", RATIO_CLASSES[ceil(round(10 * ratio, 9))])
    for entry in house.objects:
        summary.count("house_categories", entry.category or "(unknown)")


def _add_goal(summary: TaskSummary, stage: OracleStage, room_types: Mapping[str, str], earlier: set[str]) -> None:
    target, state = stage.target, stage.state
    summary.add("goal_relocated_all", target.is_relocated_ever)
    summary.add("goals_refused", len(stage.rejections))
    summary.count("goal_categories", target.category)
    summary.count("goal_rooms", room_types.get(target.room_id, "(unknown)"))
    summary.count("goal_scores", f"{target.score:g}")
    for rejection in stage.rejections:
        summary.count("goal_rejections", rejection.reason)
    summary.add_value("path_m", stage.reference_path_length_m)
    x_m, _, z_m = target.position_m
    place = stage.reference_pose.position_m
    summary.add_value("reference_distance_m", dist((x_m, z_m), (place[0], place[2])))
    summary.add_value("visible_px", stage.reference_visible_px)
    if stage.stage > 1:
        summary.add("goal_relocated", target.is_relocated_ever)
        summary.add("goal_again", target.id in earlier)
        # The state is from before the goal was drawn: its last goal room is that of the previous stage.
        summary.add("goal_room_again", bool(state.goal_room_ids) and target.room_id == state.goal_room_ids[-1])


def _add_transition(
    summary: TaskSummary, stage: OracleStage, previous: Evolution | None, objects_by_room: Mapping[str | None, int]
) -> None:
    evolution, target = stage.evolution, stage.target
    is_evolved = evolution.outcome == "evolved"
    summary.add("static", not is_evolved)
    summary.count("outcomes", evolution.outcome)
    if evolution.outcome != "not_triggered":
        summary.add("unchanged", not is_evolved)
        failure = getattr(evolution, "failure", None)
        if not is_evolved:
            summary.count("failures", str(failure or evolution.outcome))
        if evolution.mode is not None:
            summary.count("modes_drawn", evolution.mode)
    mode = evolution.mode
    if not is_evolved or mode is None:
        return
    for one in MODES:
        summary.add(f"mode_{one}", mode == one)
    summary.count("modes", mode)
    relocated = set(evolution.relocated_ids)
    unmoved = set(evolution.unmoved_ids) - relocated
    summary.add("goal_in_changed_room", target.room_id == evolution.room_id)
    summary.add("goal_moved", target.is_relocated_now)
    summary.add(f"goal_moved_{mode}", target.is_relocated_now)
    if evolution.salient_id is not None:
        summary.add("goal_is_salient", target.id == evolution.salient_id)
    summary.add("room_relocated", len(relocated), max(1, objects_by_room[evolution.room_id]))
    summary.add(f"room_relocated_{mode}", len(relocated), max(1, objects_by_room[evolution.room_id]))
    summary.add("unmoved", len(unmoved), len(unmoved) + len(relocated))
    summary.add(f"unmoved_{mode}", len(unmoved), len(unmoved) + len(relocated))
    for change in evolution.changes:
        if change.is_relocated:
            summary.add_value("displacement_m", change.displacement_m)
    if previous is not None and previous.outcome == "evolved":
        summary.add("room_again", previous.room_id == evolution.room_id)


def _add_during(summary: TaskSummary, during: DuringRecord | None) -> None:
    summary.add("during", during is not None)
    if during is not None:
        summary.add("during_target", during.is_target_relocated)
        summary.count("during_modes", during.evolution.mode or "(none)")
        summary.add_value("during_round", during.round)


def read_summary(root: Path) -> TaskSummary:
    """Summarise the task in a folder; checksums, images and later houses are not read.

    Raises:
        TaskError: A file is malformed; names file, field and value.
    """
    header = parse_record(TaskHeader, read_file(root / "task.json"), root / "task.json")
    numbers = range(1, header.num_stages + 1)
    oracle = [root / f"oracle/stage_{number}.json" for number in numbers]
    public = [root / f"public/stage_{number}.json" for number in numbers]
    house = root / "houses/stage_1.json.gz"
    try:
        return summary_of(
            header,
            [parse_record(OracleStage, read_file(path), path) for path in oracle],
            [parse_record(PublicStage, read_file(path), path) for path in public],
            read_gzip(house).decode(),
        )
    except (HouseError, UnicodeDecodeError) as error:
        raise TaskError(f"{house}: {error}") from error


def read_summaries(roots: Sequence[Path], *, num_workers: int = 1) -> Iterator[TaskSummary]:
    """Summarise many tasks in order, with worker processes if `num_workers` is at least 2.

    Raises:
        TaskError: A file is malformed; names file, field and value.
    """
    if num_workers <= 1 or len(roots) <= 2 * CHUNK:
        yield from map(read_summary, roots)
        return
    chunks = [[str(root) for root in roots[first : first + CHUNK]] for first in range(0, len(roots), CHUNK)]
    jobs = (Job(number, json.dumps(chunk)) for number, chunk in enumerate(chunks))
    waiting: dict[int, list[TaskSummary]] = {}
    num_given = 0
    with open_pool(WORK, "", Workforce(num_workers), timeout_s=CHUNK_TIMEOUT_S) as pool:
        for answer in answers(pool, jobs):
            waiting[answer.key] = _summaries_of(answer, chunks[answer.key])
            while num_given in waiting:
                yield from waiting.pop(num_given)
                num_given += 1


def make_reader(_settings: str, alive: Callable[[], None]) -> Callable[[str], str]:
    """Return the function from a JSON list of folders to their summaries or `{"error": ...}`, for the pool."""

    def read(text: str) -> str:
        found = []
        try:
            for root in json.loads(text):
                found.append(read_summary(Path(root)))
                alive()
        except (TaskError, OSError) as error:
            return json.dumps({"error": str(error)})
        return _SUMMARIES.dump_json(found).decode()

    return read


def _summaries_of(answer: Answer, chunk: Sequence[str]) -> list[TaskSummary]:
    if answer.failure is not None:
        raise TaskError(f"{chunk[0]} to {chunk[-1]}: {answer.detail.strip().splitlines()[-1]}")
    if answer.text.startswith("{"):
        raise TaskError(json.loads(answer.text)["error"])
    return _SUMMARIES.validate_json(answer.text)
