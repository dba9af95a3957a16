"""Make the JSON Schema (draft 2020-12) of task files from the records that parse them.

`evonav tasks schema` writes them, so that programs in other languages can check files. JSON has no NaN and no infinity,
and keys that are not listed are forbidden. Problems that a schema cannot express (files that contradict each other,
checksums, physics) are found by `evonav tasks validate`.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from evonav.errors import TaskError
from evonav.records import Record
from evonav.tasks.dataset import DatasetRecord
from evonav.tasks.manifest import PublicStage, TaskHeader
from evonav.tasks.oracle import OracleStage
from evonav.tasks.records import described_schema

DIALECT = "https://json-schema.org/draft/2020-12/schema"

MODELS: Mapping[str, type[Record]] = MappingProxyType(
    {"dataset": DatasetRecord, "oracle_stage": OracleStage, "public_stage": PublicStage, "task": TaskHeader}
)
"""Kinds of files: `dataset.json`, `oracle/stage_k.json`, `public/stage_k.json`, `task.json`."""


def schema_of(name: str) -> dict[str, Any]:
    """Return the schema of a kind of file.

    Args:
        name: A key of `MODELS`.

    Raises:
        TaskError: The kind does not exist.
    """
    if name not in MODELS:
        raise TaskError(f"schema {name!r}: expected one of {', '.join(MODELS)}")
    model = MODELS[name]
    schema = described_schema(model)
    for part in (schema, *schema.get("$defs", {}).values()):
        for field in part["properties"].values():
            if "description" in field:
                field["description"] = " ".join(field.pop("description").split())
    version = model.model_fields["schema_version"].default
    return {"$schema": DIALECT, "$id": f"urn:evonav:schema:{version}:{name}", **schema}


def schema_text(name: str) -> str:
    """Return the text of a schema's file."""
    return json.dumps(schema_of(name), indent=2) + "\n"


def write_schemas(directory: Path | str) -> list[Path]:
    """Write all schemas, `NAME.schema.json`.

    Raises:
        TaskError: A file cannot be written.
    """
    directory = Path(directory)
    paths = [directory / f"{name}.schema.json" for name in MODELS]
    try:
        directory.mkdir(parents=True, exist_ok=True)
        for name, path in zip(MODELS, paths, strict=True):
            path.write_text(schema_text(name), encoding="utf-8")
    except OSError as error:
        raise TaskError(f"{directory}: cannot be written: {error.strerror or error}") from error
    return paths
