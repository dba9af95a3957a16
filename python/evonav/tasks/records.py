"""Parse and write task files as strict records, with errors that name file, field and value."""

import ast
import gzip
import hashlib
import inspect
import math
import zlib
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from io import BytesIO
from itertools import pairwise
from pathlib import Path
from textwrap import dedent
from typing import Annotated, Any, TypeVar, get_args

from pydantic import Field, ValidationError

from evonav.errors import TaskError
from evonav.points import Point3
from evonav.records import Record, sentences_of, wrong_value
from evonav.world.pose import Pose

MAX_FILE_BYTES = 64 * 2**20
"""Uncompressed size beyond which a task file is refused; a 10-room house takes 0.3 MB."""

Id = Annotated[str, Field(min_length=1, max_length=256)]
Probability = Annotated[float, Field(ge=0.0, le=1.0)]
Sha256 = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]


class PoseRecord(Record):
    """A pose as AI2-THOR writes it, with angles in degrees."""

    position_m: Point3
    yaw_deg: float
    horizon_deg: float

    def pose(self) -> Pose:
        """Return the pose, in radians."""
        x_m, y_m, z_m = self.position_m
        return Pose(x_m, y_m, z_m, math.radians(self.yaw_deg), math.radians(self.horizon_deg))


def descriptions(model: type) -> dict[str, str]:
    """Return the strings below the fields of a record or a dataclass in the source.

    Pydantic can read them, too, but whenever records are imported, which takes as long as all else of the import.
    """
    found = {}
    for kind in reversed(model.__mro__):
        if issubclass(kind, Record) or is_dataclass(kind):
            (source,) = ast.parse(dedent(inspect.getsource(kind))).body
            assert isinstance(source, ast.ClassDef)
            for field, below in pairwise(source.body):
                match field, below:
                    case ast.AnnAssign(target=ast.Name(id=name)), ast.Expr(value=ast.Constant(value=str(text))):
                        found[name] = inspect.cleandoc(text)
    return found


def described_schema(model: type[Record]) -> dict[str, Any]:
    """Return the JSON Schema of a record, in which fields have their descriptions."""
    schema = model.model_json_schema(mode="validation")
    models = {one.__name__: one for one in _records_in(model)}
    for title, part in {model.__name__: schema, **schema.get("$defs", {})}.items():
        for field, text in descriptions(models[title]).items():
            known = part["properties"][field]
            part["properties"][field] = dict(sorted({**known, "description": text}.items()))
    return schema


def _records_in(annotation: Any) -> Iterator[type]:  # noqa: ANN401 - a type hint
    """Yield the records and dataclasses that a type consists of, and all that they consist of."""
    if isinstance(annotation, type) and issubclass(annotation, Record):
        yield annotation
        for field in annotation.model_fields.values():
            yield from _records_in(field.annotation)
    elif isinstance(annotation, type) and is_dataclass(annotation):
        yield annotation
        for part in fields(annotation):
            yield from _records_in(part.type)
    for part in get_args(annotation):
        yield from _records_in(part)


RecordT = TypeVar("RecordT", bound=Record)


def parse_record(model: type[RecordT], data: bytes, path: Path) -> RecordT:
    """Parse a record from JSON.

    Args:
        data: UTF-8 JSON.

    Raises:
        TaskError: The first problem, with file, field and value.
    """
    record, errors = record_errors(model, data, path)
    if record is None:
        raise errors[0]
    return record


def record_errors(model: type[RecordT], data: bytes, path: Path) -> tuple[RecordT | None, list[TaskError]]:
    """Parse a record from JSON; if that fails, return all problems, each with file, field and value."""
    try:
        return model.model_validate_json(data), []
    except ValidationError as error:
        return None, [TaskError(f"{path}: {sentence}") for sentence in sentences_of(error)]


def field_error(path: Path, place: str, value: Any, message: str) -> TaskError:  # noqa: ANN401
    """Return a `TaskError` in the form of all task files."""
    return TaskError(f"{path}: {wrong_value(place, value, message)}")


def read_file(path: Path, max_bytes: int = MAX_FILE_BYTES) -> bytes:
    """Return the contents of a task's file.

    Raises:
        TaskError: The file cannot be read, or is larger than `max_bytes`.
    """
    try:
        with path.open("rb") as file:
            data = file.read(max_bytes + 1)
    except OSError as error:
        raise TaskError(f"{path}: cannot be read: {error.strerror or error}") from error
    if len(data) > max_bytes:
        raise TaskError(f"{path}: larger than {max_bytes} bytes")
    return data


def read_gzip(path: Path) -> bytes:
    """Return the uncompressed contents of a gzipped task file.

    Raises:
        TaskError: The file cannot be read, is not a complete gzip file, or is too large.
    """
    packed = read_file(path)
    if not packed:
        raise TaskError(f"{path}: empty")
    try:
        with gzip.open(BytesIO(packed)) as file:
            data = file.read(MAX_FILE_BYTES + 1)
    except (OSError, EOFError, zlib.error) as error:
        raise TaskError(f"{path}: not a complete gzip file: {error}") from error
    if len(data) > MAX_FILE_BYTES:
        raise TaskError(f"{path}: uncompressed, larger than {MAX_FILE_BYTES} bytes")
    return data


def write_gzip(data: bytes) -> bytes:
    """Compress without time stamp or name, so that the same contents give the same bytes (for one zlib build)."""
    return gzip.compress(data, compresslevel=6, mtime=0)


def record_bytes(record: Record) -> bytes:
    """Return a record as UTF-8 JSON, indented by two spaces, with a final newline."""
    return (record.model_dump_json(indent=2) + "\n").encode()


def sha256_of(data: bytes) -> str:
    """Return the SHA-256 in hexadecimal."""
    return hashlib.sha256(data).hexdigest()
