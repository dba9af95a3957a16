"""What statistics need of one task, read without pictures, later houses and checksums."""

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
from evonav.tasks.manifest import PublicStage, TaskHeader
from evonav.tasks.oracle import Evolution, OracleStage
from evonav.tasks.records import parse_record, read_file, read_gzip

MODES = ("SALIENT_OBJECT", "RETAIN_GROUP", "FULL_SHUFFLE")
RATIO_CLASSES = ("0%", *(f"{10 * i}-{10 * i + 10}%" for i in range(10)))
"""Of the relocated-object ratio, each up to and including its upper end."""
CHUNK = 16
"""Tasks a worker process reads at a time."""
CHUNK_TIMEOUT_S = 300.0
"""For one task of them."""
WORK = "evonav.generation.statistics.task_summary:make_reader"

_PLAN = re.compile(r'"roomSpecId"\s*:\s*"([^"\\]{1,80})"')


@dataclass(slots=True)
class TaskFacts:
    """One task in numbers: of each measure its part above and below the line."""

    task_id: str
    house_sha256: str
    seed: int
    generator: str
    parameters: str
    """Θ, JSON."""
    num_stages: int
    num_rooms: int
    plan: str | None
    """`metadata.roomSpecId` of the house."""
    expected_evolutions: tuple[float, ...]
    """Chance of 0, 1, ... evolved transitions under Θ."""
    expected_modes: tuple[float, float, float]
    sums: dict[str, list[float]] = field(default_factory=dict)
    """Numerator and denominator by measure."""
    counts: dict[str, Counter[str]] = field(default_factory=dict)
    values: dict[str, list[float]] = field(default_factory=dict)

    def add(self, key: str, numerator: float, denominator: float = 1) -> None:
        """Adds to a measure."""
        sums = self.sums.setdefault(key, [0.0, 0.0])
        sums[0] += numerator
        sums[1] += denominator

    def count(self, key: str, name: str, times: int = 1) -> None:
        """Counts one of a distribution."""
        self.counts.setdefault(key, Counter())[name] += times

    def note(self, key: str, value: float) -> None:
        """Notes a quantity."""
        self.values.setdefault(key, []).append(value)


_FACTS = TypeAdapter(list[TaskFacts])


def expected_evolutions(num_stages: Sequence[int], probability: float) -> tuple[float, ...]:
    """Chance of 0, 1, ... evolved transitions, K being uniform on `num_stages`."""
    shares = [0.0] * max(num_stages)
    for stages in num_stages:
        for evolved in range(stages):
            chance = comb(stages - 1, evolved) * probability**evolved * (1 - probability) ** (stages - 1 - evolved)
            shares[evolved] += chance / len(num_stages)
    return tuple(shares)


def facts_of(
    header: TaskHeader, oracle: Sequence[OracleStage], public: Sequence[PublicStage], house_json: str
) -> TaskFacts:
    """Facts of a task.

    Args:
        header: Its header.
        oracle: Oracle part of its stages, in order.
        public: Public part.
        house_json: First house.

    Raises:
        HouseError: The house is malformed.
    """
    theta = header.parameters
    plan = _PLAN.search(house_json)
    modes = (theta.salient_object_probability, theta.retain_group_probability, theta.full_shuffle_probability)
    total = sum(modes) or 1.0
    facts = TaskFacts(
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
    _note_task(facts, header, oracle, house)
    previous: Evolution | None = None
    earlier: set[str] = set()
    for stage in oracle:
        _note_goal(facts, stage, room_types, earlier)
        earlier.add(stage.target.id)
        if stage.stage > 1:
            _note_transition(facts, stage, previous, objects_by_room)
            previous = stage.evolution
    for one in public:
        for name in ("basic", "appearance", "unified"):
            facts.note(f"{name}_words", len(getattr(one, f"{name}_instruction").split()))
    return facts


def _note_task(facts: TaskFacts, header: TaskHeader, oracle: Sequence[OracleStage], house: House) -> None:
    num_evolutions = sum(stage.evolution.outcome == "evolved" for stage in oracle)
    ratio = len(oracle[-1].ever_relocated_ids) / header.house.num_objects
    facts.add("evolved_once", num_evolutions >= 1)
    facts.add("evolved_twice", num_evolutions >= 2)
    facts.add("num_stages", header.num_stages)
    facts.add("ratio_zero", ratio == 0)
    facts.add("ratio_above_80", ratio > 0.8)
    facts.note("relocated_ratio", ratio)
    facts.note("task_path_m", sum(stage.reference_path_length_m for stage in oracle))
    facts.note("num_rooms", header.house.num_rooms)
    facts.note("num_objects", header.house.num_objects)
    facts.count("num_evolutions", str(num_evolutions))
    facts.count("num_stages", str(header.num_stages))
    facts.count("num_rooms", str(header.house.num_rooms))
    facts.count("relocated_ratio", RATIO_CLASSES[ceil(round(10 * ratio, 9))])
    for entry in house.objects:
        facts.count("house_categories", entry.category or "(unknown)")


def _note_goal(facts: TaskFacts, stage: OracleStage, room_types: Mapping[str, str], earlier: set[str]) -> None:
    target, state = stage.target, stage.state
    facts.add("goal_relocated_all", target.is_relocated_ever)
    facts.add("goals_refused", len(stage.rejections))
    facts.count("goal_categories", target.category)
    facts.count("goal_rooms", room_types.get(target.room_id, "(unknown)"))
    facts.count("goal_scores", f"{target.score:g}")
    for rejection in stage.rejections:
        facts.count("goal_rejections", rejection.reason)
    facts.note("path_m", stage.reference_path_length_m)
    x_m, _, z_m = target.position_m
    place = stage.reference_pose.position_m
    facts.note("reference_distance_m", dist((x_m, z_m), (place[0], place[2])))
    facts.note("visible_px", stage.reference_visible_px)
    if stage.stage > 1:
        facts.add("goal_relocated", target.is_relocated_ever)
        facts.add("goal_again", target.id in earlier)
        # The state is as of before the goal was drawn: its last goal room is the previous stage's.
        facts.add("goal_room_again", bool(state.goal_room_ids) and target.room_id == state.goal_room_ids[-1])


def _note_transition(
    facts: TaskFacts, stage: OracleStage, previous: Evolution | None, objects_by_room: Mapping[str | None, int]
) -> None:
    evolution, target = stage.evolution, stage.target
    is_evolved = evolution.outcome == "evolved"
    facts.add("static", not is_evolved)
    facts.count("outcomes", evolution.outcome)
    if evolution.outcome != "not_triggered":
        facts.add("unchanged", not is_evolved)
        failure = getattr(evolution, "failure", None)
        if not is_evolved:
            facts.count("failures", str(failure or evolution.outcome))
        if evolution.mode is not None:
            facts.count("modes_drawn", evolution.mode)
    mode = evolution.mode
    if not is_evolved or mode is None:
        return
    for one in MODES:
        facts.add(f"mode_{one}", mode == one)
    facts.count("modes", mode)
    relocated = set(evolution.relocated_ids)
    unmoved = set(evolution.unmoved_ids) - relocated
    facts.add("goal_in_changed_room", target.room_id == evolution.room_id)
    facts.add("goal_moved", target.is_relocated_now)
    facts.add(f"goal_moved_{mode}", target.is_relocated_now)
    if evolution.salient_id is not None:
        facts.add("goal_is_salient", target.id == evolution.salient_id)
    facts.add("room_relocated", len(relocated), max(1, objects_by_room[evolution.room_id]))
    facts.add(f"room_relocated_{mode}", len(relocated), max(1, objects_by_room[evolution.room_id]))
    facts.add("unmoved", len(unmoved), len(unmoved) + len(relocated))
    facts.add(f"unmoved_{mode}", len(unmoved), len(unmoved) + len(relocated))
    for change in evolution.changes:
        if change.is_relocated:
            facts.note("displacement_m", change.displacement_m)
    if previous is not None and previous.outcome == "evolved":
        facts.add("room_again", previous.room_id == evolution.room_id)


def read_facts(root: Path) -> TaskFacts:
    """Facts of a task's folder; checksums, pictures and later houses are left alone.

    Raises:
        TaskError: A file is malformed; it names file, field and value.
    """
    header = parse_record(TaskHeader, read_file(root / "task.json"), root / "task.json")
    numbers = range(1, header.num_stages + 1)
    oracle = [root / f"oracle/stage_{number}.json" for number in numbers]
    public = [root / f"public/stage_{number}.json" for number in numbers]
    house = root / "houses/stage_1.json.gz"
    try:
        return facts_of(
            header,
            [parse_record(OracleStage, read_file(path), path) for path in oracle],
            [parse_record(PublicStage, read_file(path), path) for path in public],
            read_gzip(house).decode(),
        )
    except (HouseError, UnicodeDecodeError) as error:
        raise TaskError(f"{house}: {error}") from error


def read_all_facts(roots: Sequence[Path], *, num_workers: int = 1) -> Iterator[TaskFacts]:
    """Facts of many tasks, in order, in worker processes where more than one is wanted.

    Args:
        roots: Folders of tasks.
        num_workers: Processes.

    Raises:
        TaskError: As `read_facts`.
    """
    if num_workers <= 1 or len(roots) <= 2 * CHUNK:
        yield from map(read_facts, roots)
        return
    chunks = [[str(root) for root in roots[first : first + CHUNK]] for first in range(0, len(roots), CHUNK)]
    jobs = (Job(number, json.dumps(chunk)) for number, chunk in enumerate(chunks))
    waiting: dict[int, list[TaskFacts]] = {}
    num_given = 0
    with open_pool(WORK, "", num_workers=num_workers, timeout_s=CHUNK_TIMEOUT_S) as pool:
        for answer in answers(pool, jobs):
            waiting[answer.key] = _facts_in(answer, chunks[answer.key])
            while num_given in waiting:
                yield from waiting.pop(num_given)
                num_given += 1


def make_reader(_settings: str, alive: Callable[[], None]) -> Callable[[str], str]:
    """Return the function from a JSON list of folders to their facts, or `{"error": ...}`."""

    def read(text: str) -> str:
        found = []
        try:
            for root in json.loads(text):
                found.append(read_facts(Path(root)))
                alive()
        except (TaskError, OSError) as error:
            return json.dumps({"error": str(error)})
        return _FACTS.dump_json(found).decode()

    return read


def _facts_in(answer: Answer, chunk: Sequence[str]) -> list[TaskFacts]:
    if answer.failure is not None:
        raise TaskError(f"{chunk[0]} to {chunk[-1]}: {answer.detail.strip().splitlines()[-1]}")
    if answer.text.startswith("{"):
        raise TaskError(json.loads(answer.text)["error"])
    return _FACTS.validate_json(answer.text)
