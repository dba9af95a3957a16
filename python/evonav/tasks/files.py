"""Read, check and write the files of a task."""

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evonav import _core
from evonav.errors import InvalidArgumentError, TaskError
from evonav.tasks.listing import task_roots
from evonav.tasks.manifest import PublicStage, Task, TaskHeader
from evonav.tasks.oracle import OracleStage
from evonav.tasks.records import field_error, parse_record, read_file, read_gzip, record_bytes, sha256_of, write_gzip


def encode_png(image: NDArray[np.uint8]) -> bytes:
    """Return an RGB image as PNG, without metadata; the core takes a seventh of Pillow's time."""
    return _core.encode_png(np.ascontiguousarray(image))


def decode_png(path: Path, size_px: int) -> NDArray[np.uint8]:
    """Read a square RGB image, `(S, S, 3)`, read-only.

    Raises:
        TaskError: The file is not a PNG, not RGB, or of another size.
    """
    data = read_file(path)
    # Size, depth and colour type stand in the first chunk. They are checked first, so that huge images are not decoded.
    if data[:16] != b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR" or data[16:26] != struct.pack(">IIBB", size_px, size_px, 8, 2):
        raise field_error(path, "IHDR", data[:26], f"expected an 8-bit RGB PNG image of {size_px}x{size_px} px")
    try:
        pixels = _core.decode_png(data)
    except InvalidArgumentError as error:
        raise TaskError(f"{path}: not a complete PNG image: {error}") from error
    pixels.flags.writeable = False
    return pixels


def write_task(task: Task, directory: Path | str) -> Path:
    """Write a task's files to `directory`/`task_id`.

    Returns:
        The task's own directory.

    Raises:
        TaskError: A file cannot be written.
    """
    root = Path(directory) / task.task_id
    try:
        for folder in (root, *(root / name for name in ("houses", "oracle", "public"))):
            folder.mkdir(parents=True, exist_ok=True)
        (root / "task.json").write_bytes(record_bytes(task.header))
        for name, data in _encoded_files(task):
            (root / name).write_bytes(data)
    except OSError as error:
        raise TaskError(f"{root}: cannot be written: {error.strerror or error}") from error
    return root


def _encoded_files(task: Task) -> Iterator[tuple[str, bytes]]:
    """Yield the path and bytes of each file of a task except `task.json`."""
    house, compressed = b"", b""
    for name, data in task.contents.items():
        if name.startswith("houses/"):
            if data != house:  # half of the stages have the house of the previous stage
                house, compressed = data, write_gzip(data)
            yield name, compressed
        elif name.endswith(".png"):
            number = int(name.removeprefix("public/stage_").removesuffix(".png"))
            yield name, encode_png(task.reference_images[number - 1])
        else:
            yield name, data


def load_task(root: Path | str) -> Task:
    """Read one task's directory and check it.

    Raises:
        TaskError: A file is missing or malformed; the message names file, field and value.
    """
    root = Path(root)
    header_path = root / "task.json"
    header = parse_record(TaskHeader, read_file(header_path), header_path)
    if header.task_id != root.name:
        raise field_error(header_path, "task_id", header.task_id, f"expected the directory's name, {root.name!r}")
    numbers = range(1, header.num_stages + 1)
    public = [root / f"public/stage_{number}.json" for number in numbers]
    oracle = [root / f"oracle/stage_{number}.json" for number in numbers]
    task = Task(
        header=header,
        public_stages=tuple(parse_record(PublicStage, read_file(path), path) for path in public),
        reference_images=tuple(
            decode_png(path.with_suffix(".png"), header.parameters.reference_image_px) for path in public
        ),
        oracle_stages=tuple(parse_record(OracleStage, read_file(path), path) for path in oracle),
        houses_json=tuple(read_house(root / f"houses/stage_{number}.json.gz") for number in numbers),
        root=root,
    )
    for found in inconsistencies(task, root):
        raise found.error
    return task


def read_house(path: Path) -> str:
    """Return a stage's house as ProcTHOR JSON.

    Raises:
        TaskError: The file is missing, damaged or not text.
    """
    try:
        return read_gzip(path).decode()
    except UnicodeDecodeError as error:
        raise TaskError(f"{path}: not UTF-8: {error}") from error


class Inconsistency(NamedTuple):
    """Two files that contradict each other."""

    kind: Literal["checksum", "contradiction"]
    stage: int
    """Number of the stage, 0 for the header."""
    error: TaskError


def inconsistencies(task: Task, root: Path) -> Iterator[Inconsistency]:
    """Yield the problems that no single file of a task shows."""
    header_path = root / "task.json"
    for number, (public, oracle) in enumerate(zip(task.public_stages, task.oracle_stages, strict=True), start=1):
        public_path, oracle_path = root / f"public/stage_{number}.json", root / f"oracle/stage_{number}.json"
        places = (
            (public_path, "stage", public.stage, number),
            (oracle_path, "stage", oracle.stage, number),
            (public_path, "category", public.category, oracle.target.category),
        )
        for path, place, found, expected in places:
            if found != expected:
                error = field_error(path, place, found, f"expected {expected!r}")
                yield Inconsistency("contradiction", number, error)
        if sha256_of(task.houses_json[number - 1].encode()) != oracle.house_sha256:
            message = f"does not match houses/stage_{number}.json.gz"
            error = field_error(oracle_path, "house_sha256", oracle.house_sha256, message)
            yield Inconsistency("checksum", number, error)
    if task.header.start_pose != task.oracle_stages[0].start_pose:
        error = field_error(header_path, "start_pose", task.header.start_pose, "expected that of oracle stage 1")
        yield Inconsistency("contradiction", 0, error)
    if task.oracle_stages[0].house_sha256 != task.header.house.sha256:
        message = "does not match houses/stage_1.json.gz"
        error = field_error(header_path, "house.sha256", task.header.house.sha256, message)
        yield Inconsistency("checksum", 0, error)
    for problem in _control_problems(task):
        yield Inconsistency("contradiction", 0, field_error(header_path, "control", task.header.control, problem))
    expected_sums = task.checksums
    for name in sorted(expected_sums.keys() | task.header.checksums.keys()):
        found_sum = task.header.checksums.get(name)
        if expected_sums.get(name) != found_sum:
            error = field_error(header_path, f"checksums.{name}", found_sum, "does not match the file's contents")
            yield Inconsistency("checksum", 0, error)


def _control_problems(task: Task) -> Iterator[str]:
    """Yield the contradictions between a header's `control` and the stages."""
    control = task.header.control
    if control is None:
        return
    numbers = range(1, task.num_stages + 1)
    if not set(control.guided_stages) < set(numbers):
        yield f"expected guided_stages of 1 to {task.num_stages}, and not all of them"
    is_earlier = all(1 <= shown <= stage for stage, shown in zip(numbers, control.shown_goals, strict=False))
    if len(control.shown_goals) != task.num_stages or not is_earlier:
        yield f"expected shown_goals of {task.num_stages} stages, each its own or an earlier one"
        return
    for stage, shown in zip(numbers, control.shown_goals, strict=True):
        same = task.public_stages[shown - 1].model_copy(update={"stage": stage})
        is_same_image = np.array_equal(task.reference_images[stage - 1], task.reference_images[shown - 1])
        if task.public_stages[stage - 1] != same or not is_same_image:
            yield f"expected stage {stage} to have the instructions and image of stage {shown}"
        if task.oracle_stages[stage - 1].target.id != task.oracle_stages[shown - 1].target.id:
            yield f"expected stage {stage} to have the target of stage {shown}"


def load_tasks(directory: Path | str, limit: int | None = None) -> Iterator[Task]:
    """Read a data set, one task at a time, in order of task id.

    Args:
        limit: Largest number of tasks to read; default all.

    Raises:
        TaskError: The folder has no task, or a task is malformed.
    """
    for root in task_roots(Path(directory))[:limit]:
        yield load_task(root)
