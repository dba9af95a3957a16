"""Check a task's files, alone and together, and find every problem; `load_task` stops at the first."""

import re
import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from evonav.errors import TaskError
from evonav.generation.validation.problems import Problem, ProblemKind
from evonav.records import Record
from evonav.tasks.files import decode_png, inconsistencies, read_house
from evonav.tasks.manifest import PublicStage, Task, TaskHeader
from evonav.tasks.oracle import OracleStage
from evonav.tasks.records import read_file, record_errors

_Anything = TypeVar("_Anything")
_Record = TypeVar("_Record", bound=Record)

PNG_CHUNKS = (b"IHDR", b"IDAT", b"IEND")
"""Chunks of a reference image; others may contain text."""
MAX_STAGES = 64


def read_all(root: Path) -> tuple[Task | None, list[Problem]]:
    """Read a task's folder.

    Returns:
        The task, or `None` if one of its files cannot be read; and all problems.
    """
    reader = _Reader(root)
    header = reader.record(0, TaskHeader, root / "task.json")
    if header is None:
        return None, reader.problems
    if header.task_id != root.name:
        reader.add(0, "contradiction", f"task.json: task_id is {header.task_id!r}, the folder's name {root.name!r}")
    numbers = range(1, header.num_stages + 1)
    side_px = header.parameters.reference_image_px
    public, oracle, images, houses = [], [], [], []
    for number in numbers:
        public.append(reader.record(number, PublicStage, root / f"public/stage_{number}.json"))
        oracle.append(reader.record(number, OracleStage, root / f"oracle/stage_{number}.json"))
        images.append(reader.image(number, root / f"public/stage_{number}.png", side_px))
        houses.append(reader.read(number, read_house, root / f"houses/stage_{number}.json.gz"))
    reader.find_unexpected_files(header)
    task = Task(
        header=header,
        public_stages=tuple(stage for stage in public if stage is not None),
        reference_images=tuple(image for image in images if image is not None),
        oracle_stages=tuple(stage for stage in oracle if stage is not None),
        houses_json=tuple(house for house in houses if house is not None),
    )
    parts = (task.public_stages, task.reference_images, task.oracle_stages, task.houses_json)
    if any(len(part) != header.num_stages for part in parts):
        return None, reader.problems
    for found in inconsistencies(task, root):
        reader.add(found.stage, found.kind, str(found.error))
    return task, reader.problems


class _Reader:
    """Reader of files that collects their problems."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.problems: list[Problem] = []

    def add(self, stage: int, kind: ProblemKind, detail: str) -> None:
        detail = detail.replace(f"{self.root}/", "")
        self.problems.append(Problem(task_id=self.root.name, stage=stage, kind=kind, detail=detail))

    def read(self, stage: int, function: Callable[[Path], _Anything], path: Path) -> _Anything | None:
        try:
            return function(path)
        except TaskError as error:
            self.add(stage, "file", str(error))
            return None

    def record(self, stage: int, model: type[_Record], path: Path) -> _Record | None:
        data = self.read(stage, read_file, path)
        if data is None:
            return None
        record, errors = record_errors(model, data, path)
        for error in errors:
            self.add(stage, "schema", str(error))
        return record

    def image(self, stage: int, path: Path, side_px: int) -> NDArray[np.uint8] | None:
        image = self.read(stage, lambda path: decode_png(path, side_px), path)
        if image is not None:
            for chunk in foreign_chunks(read_file(path)):
                self.add(stage, "leak", f"public/{path.name}: holds {chunk}, which may hold text")
        return image

    def find_unexpected_files(self, header: TaskHeader) -> None:
        expected = {"task.json"}
        for number in range(1, header.num_stages + 1):
            expected |= {f"public/stage_{number}.json", f"public/stage_{number}.png"}
            expected |= {f"oracle/stage_{number}.json", f"houses/stage_{number}.json.gz"}
        for path in sorted(self.root.rglob("*")):
            name = path.relative_to(self.root).as_posix()
            if not path.is_dir() and name not in expected:
                is_public = name.startswith("public/")
                self.add(0, "leak" if is_public else "stranger", f"{name}: belongs to no stage of the task")


def foreign_chunks(png: bytes) -> Iterator[str]:
    """Yield the parts of a complete PNG file other than its pixels."""
    offset = 8
    while offset + 8 <= len(png):
        (length,), kind = struct.unpack(">I", png[offset : offset + 4]), png[offset + 4 : offset + 8]
        offset += 12 + length
        if kind not in PNG_CHUNKS:
            yield f"a chunk {kind.decode('latin-1')}"
        if kind == b"IEND":
            break
    if offset < len(png):
        yield f"{len(png) - offset} bytes after its end"


def leaks(task: Task, stage: int, document: dict[str, Any]) -> Iterator[str]:
    """Yield the texts of a public stage that reveal ids or coordinates; the schema allows no other keys."""
    public = task.public_stages[stage - 1]
    ids = [str(room.get("id")) for room in document.get("rooms", [])] + list(_object_ids(document.get("objects", [])))
    for name in PublicStage.model_fields:
        text = getattr(public, name)
        if not isinstance(text, str):
            continue
        if any(_is_in(text, one) for one in ids):
            yield f"{name} names an id of the house: {text!r}"
        if re.search(r"\d\.\d|\|", text):
            yield f"{name} holds a coordinate or an id: {text!r}"


def _is_in(text: str, one: str) -> bool:
    """Return whether an id is a word of its own in a text; an id may be a number that is a part of other words."""
    return one in text and re.search(rf"(?<!\w){re.escape(one)}(?!\w)", text) is not None


def _object_ids(entries: list[dict[str, Any]]) -> Iterator[str]:
    for entry in entries:
        yield str(entry.get("id"))
        yield from _object_ids(entry.get("children") or [])
