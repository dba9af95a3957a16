"""A task: header, public stages, oracle stages, stage houses; its files and how they are read and written."""

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from io import BytesIO
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from pydantic import Field, NonNegativeFloat, PositiveFloat, PositiveInt

from evonav.errors import HouseError, TaskError
from evonav.house import House
from evonav.tasks.oracle import OracleStage
from evonav.tasks.public import StageInput
from evonav.tasks.records import (
    Id,
    Point3,
    PoseRecord,
    Record,
    Sha256,
    field_error,
    parse_record,
    read_file,
    read_gzip,
    record_bytes,
    sha256_of,
    write_gzip,
)
from evonav.world.pose import Pose

Probability = Annotated[float, Field(ge=0.0, le=1.0)]
TaskId = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,127}$")]


class GenerationParameters(Record):
    """The fixed hyperparameters Θ (paper, Sec. A.2), and what the paper leaves open."""

    num_stages: Annotated[tuple[PositiveInt, ...], Field(min_length=1)] = (3, 4, 5)
    """K is drawn uniformly from these (the paper gives the range only)."""
    evolve_probability: Probability = 0.5
    visited_factor: NonNegativeFloat = 3.0
    recently_changed_factor: NonNegativeFloat = 0.5
    changed_room_window: PositiveInt = 1
    """Transitions back in which a change counts as recent (the paper's k-2, counted by first stage)."""
    salient_object_probability: Probability = 0.5
    retain_group_probability: Probability = 0.4
    full_shuffle_probability: Probability = 0.1
    changed_room_multiplier: NonNegativeFloat = 9.0
    previous_goal_room_multiplier: NonNegativeFloat = 0.2
    moved_object_multiplier: NonNegativeFloat = 9.0
    goals_on_walls: bool = False
    """Whether what hangs on walls, which no modification moves, may be a goal. The paper uses it as an anchor of
    instructions; leaving it out of the goals brings the share of relocated goals (Sec. 3.2) to the published one."""
    reference_min_m: PositiveFloat = 1.0
    reference_max_m: PositiveFloat = 1.5
    reference_image_px: Annotated[int, Field(ge=16, le=4096)] = 300
    reference_min_visible_px: PositiveInt = 50
    """Fewest pixels of a visible target (the paper says "visible")."""
    relocated_min_m: NonNegativeFloat = 0.1
    placement_tries: PositiveInt = 100
    """Places tried for an object before it stays where it is."""


class HouseSource(Record):
    """Where a task's first house comes from."""

    name: Annotated[str, Field(max_length=512)]
    sha256: Sha256
    """Of the house JSON as evonav writes it."""
    num_rooms: PositiveInt
    num_objects: PositiveInt


class TaskHeader(Record):
    """`task.json` (paper, Sec. A.3)."""

    schema_version: Literal[1] = 1
    task_id: TaskId
    dataset: Id
    split: Id
    generator: Id
    """Program and version."""
    seed: Annotated[int, Field(ge=0, lt=2**64)]
    num_stages: Annotated[int, Field(ge=1, le=64)]
    house: HouseSource
    start_pose: PoseRecord
    parameters: GenerationParameters
    checksums: dict[str, Sha256]
    """Per file of the task, of its contents: JSON as it is, `.gz` uncompressed, `.png` its RGB values row by row."""


class PublicStage(Record):
    """`public/stage_k.json`: the goal g_k, less its start pose (which would tell where the last target was)."""

    schema_version: Literal[1] = 1
    stage: Annotated[int, Field(ge=1)]
    category: Id
    basic_instruction: Annotated[str, Field(min_length=1, max_length=2000)]
    appearance_instruction: Annotated[str, Field(min_length=1, max_length=2000)]
    unified_instruction: Annotated[str, Field(min_length=1, max_length=2000)]


class ObjectMove(Record):
    """An object's new place; what stands on it is listed as moves of its own."""

    id: Id
    position_m: Point3
    rotation_deg: Point3
    parent: Id | None


class HouseDelta(Record):
    """`houses/stage_k.json.gz` for k >= 2: what differs from the house of stage k - 1."""

    moves: tuple[ObjectMove, ...]


@dataclass(frozen=True)
class Task:
    """A task in memory. Stages count from 1."""

    header: TaskHeader
    public_stages: tuple[PublicStage, ...]
    reference_images: tuple[NDArray[np.uint8], ...]
    """`(S, S, 3)` RGB each, read-only."""
    oracle_stages: tuple[OracleStage, ...]
    first_house_json: str
    deltas: tuple[HouseDelta, ...]
    """From stage k to k + 1; one fewer than stages."""

    @property
    def task_id(self) -> str:
        """Names the task within its data set."""
        return self.header.task_id

    @property
    def num_stages(self) -> int:
        """K."""
        return self.header.num_stages

    @property
    def start_pose(self) -> Pose:
        """Where the agent starts stage 1."""
        return self.header.start_pose.pose()

    def public(self, stage: int) -> StageInput:
        """What the agent is given at a stage.

        Raises:
            IndexError: There is no such stage.
        """
        public = self.public_stages[self._index(stage)]
        return StageInput(
            stage=stage,
            category=public.category,
            basic_instruction=public.basic_instruction,
            appearance_instruction=public.appearance_instruction,
            unified_instruction=public.unified_instruction,
            reference_image=self.reference_images[self._index(stage)],
        )

    def oracle(self, stage: int) -> OracleStage:
        """What only the evaluator knows of a stage.

        Raises:
            IndexError: There is no such stage.
        """
        return self.oracle_stages[self._index(stage)]

    def house_json(self, stage: int) -> str:
        """The house of a stage, ProcTHOR JSON.

        Raises:
            IndexError: There is no such stage.
        """
        return self._houses[self._index(stage)]

    @cached_property
    def _houses(self) -> tuple[str, ...]:
        """All stage houses.

        Raises:
            TaskError: A house or a delta is malformed, or the result is not what the oracle says.
        """
        try:
            houses = [House(self.first_house_json, name=self.header.house.name)]
            for delta in self.deltas:
                houses.append(houses[-1].apply(delta.model_dump_json()) if delta.moves else houses[-1])
        except HouseError as error:
            raise TaskError(f"task {self.task_id}: houses: {error}") from error
        texts = tuple(house.to_json() for house in houses)
        for text, oracle in zip(texts, self.oracle_stages, strict=True):
            if sha256_of(text.encode()) != oracle.house_sha256:
                raise TaskError(f"task {self.task_id}: the house of stage {oracle.stage} does not match its checksum")
        return texts

    def _index(self, stage: int) -> int:
        if not 1 <= stage <= self.num_stages:
            raise IndexError(f"task {self.task_id}: stage {stage} of {self.num_stages}")
        return stage - 1


def encode_png(image: NDArray[np.uint8]) -> bytes:
    """An RGB image as PNG, without metadata."""
    buffer = BytesIO()
    Image.fromarray(image).save(buffer, "PNG", optimize=True)
    return buffer.getvalue()


def decode_png(path: Path, size_px: int) -> NDArray[np.uint8]:
    """A square RGB image, `(S, S, 3)`, read-only.

    Raises:
        TaskError: The file is no PNG, not RGB, or of another size.
    """
    data = read_file(path)
    # Size, depth and colour type stand in the first chunk; checking them first keeps huge images unread.
    if data[:16] != b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR" or data[16:26] != struct.pack(">IIBB", size_px, size_px, 8, 2):
        raise field_error(path, "IHDR", data[:26], f"expected an 8-bit RGB PNG image of {size_px}x{size_px} px")
    try:
        with Image.open(BytesIO(data), formats=["PNG"]) as image:
            pixels = np.array(image.convert("RGB"))
    except (OSError, EOFError, ValueError, SyntaxError, struct.error, zlib.error) as error:
        raise TaskError(f"{path}: not a whole PNG image: {error}") from error
    pixels.flags.writeable = False
    return pixels


def contents_of(task: Task) -> dict[str, bytes]:
    """Uncompressed contents of a task's files but `task.json`, by relative path: what checksums are taken of."""
    contents = {"houses/stage_1.json.gz": task.first_house_json.encode()}
    for number, delta in enumerate(task.deltas, start=2):
        contents[f"houses/stage_{number}.json.gz"] = record_bytes(delta)
    for number in range(1, task.num_stages + 1):
        contents[f"oracle/stage_{number}.json"] = record_bytes(task.oracle_stages[number - 1])
        contents[f"public/stage_{number}.json"] = record_bytes(task.public_stages[number - 1])
        contents[f"public/stage_{number}.png"] = task.reference_images[number - 1].tobytes()
    return dict(sorted(contents.items()))


def checksums_of(task: Task) -> dict[str, str]:
    """The checksums that the header holds."""
    return {name: sha256_of(data) for name, data in contents_of(task).items()}


def write_task(task: Task, directory: Path | str) -> Path:
    """Writes a task's files under `directory`/`task_id`.

    Returns:
        The task's own directory.

    Raises:
        TaskError: A file cannot be written.
    """
    root = Path(directory) / task.task_id
    files = {"task.json": record_bytes(task.header)}
    for name, data in contents_of(task).items():
        if name.endswith(".gz"):
            data = write_gzip(data)
        elif name.endswith(".png"):
            data = encode_png(task.reference_images[int(name.removesuffix(".png").rsplit("_", 1)[1]) - 1])
        files[name] = data
    try:
        for name, data in files.items():
            path = root / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)
    except OSError as error:
        raise TaskError(f"{root}: cannot be written: {error.strerror or error}") from error
    return root


def load_task(root: Path | str) -> Task:
    """Reads one task's directory and checks it.

    Raises:
        TaskError: With file, field and value.
    """
    root = Path(root)
    header_path = root / "task.json"
    header = parse_record(TaskHeader, read_file(header_path), header_path)
    if header.task_id != root.name:
        raise field_error(header_path, "task_id", header.task_id, f"expected the directory's name, {root.name!r}")
    numbers = range(1, header.num_stages + 1)
    public = [root / f"public/stage_{number}.json" for number in numbers]
    oracle = [root / f"oracle/stage_{number}.json" for number in numbers]
    deltas = [root / f"houses/stage_{number}.json.gz" for number in numbers[1:]]
    house_path = root / "houses/stage_1.json.gz"
    try:
        first_house_json = read_gzip(house_path).decode()
    except UnicodeDecodeError as error:
        raise TaskError(f"{house_path}: not UTF-8: {error}") from error
    task = Task(
        header=header,
        public_stages=tuple(parse_record(PublicStage, read_file(path), path) for path in public),
        reference_images=tuple(
            decode_png(path.with_suffix(".png"), header.parameters.reference_image_px) for path in public
        ),
        oracle_stages=tuple(parse_record(OracleStage, read_file(path), path) for path in oracle),
        first_house_json=first_house_json,
        deltas=tuple(parse_record(HouseDelta, read_gzip(path), path) for path in deltas),
    )
    _check(task, root)
    return task


def _check(task: Task, root: Path) -> None:
    """What no single file can tell.

    Raises:
        TaskError: Files contradict each other or their checksums.
    """
    header_path = root / "task.json"
    for number, (public, oracle) in enumerate(zip(task.public_stages, task.oracle_stages, strict=True), start=1):
        public_path, oracle_path = root / f"public/stage_{number}.json", root / f"oracle/stage_{number}.json"
        if public.stage != number:
            raise field_error(public_path, "stage", public.stage, f"expected {number}")
        if oracle.stage != number:
            raise field_error(oracle_path, "stage", oracle.stage, f"expected {number}")
        if public.category != oracle.target.category:
            raise field_error(public_path, "category", public.category, f"expected {oracle.target.category!r}")
        moved = () if number == 1 else tuple(move.id for move in task.deltas[number - 2].moves)
        changed = tuple(change.id for change in oracle.evolution.changes)
        if changed != moved:
            raise field_error(oracle_path, "evolution.changes", changed, "expected the moves of the house file")
    if task.header.start_pose != task.oracle_stages[0].start_pose:
        raise field_error(header_path, "start_pose", task.header.start_pose, "expected that of oracle stage 1")
    if sha256_of(task.first_house_json.encode()) != task.header.house.sha256:
        message = "does not match houses/stage_1.json.gz"
        raise field_error(header_path, "house.sha256", task.header.house.sha256, message)
    expected = checksums_of(task)
    for name in sorted(expected.keys() | task.header.checksums.keys()):
        if expected.get(name) != task.header.checksums.get(name):
            found = task.header.checksums.get(name)
            raise field_error(header_path, f"checksums.{name}", found, "does not match the file's contents")


def load_tasks(directory: Path | str, limit: int | None = None) -> Iterator[Task]:
    """Reads a data set, a task at a time, in order of task id.

    Args:
        directory: Holds one directory a task.
        limit: Most tasks to read; default all.

    Raises:
        TaskError: There is no task in it, or one is malformed.
    """
    directory = Path(directory)
    try:
        roots = sorted(path.parent for path in directory.glob("*/task.json"))
    except OSError as error:
        raise TaskError(f"{directory}: cannot be read: {error.strerror or error}") from error
    if not roots:
        raise TaskError(f"{directory}: holds no task (expected */task.json)")
    for root in roots[:limit]:
        yield load_task(root)
