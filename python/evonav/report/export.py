"""Export stages and rounds as rows for other programs: CSV, JSON lines, Parquet, and columns for a notebook."""

import ast
import csv
import inspect
import io
import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, fields
from itertools import islice
from pathlib import Path
from typing import Any

from evonav.component import optional_module
from evonav.errors import StoreError
from evonav.evaluation.metrics import stage_metrics as metrics
from evonav.evaluation.metrics.stage_metrics import StageMetrics
from evonav.evaluation.metrics.stage_rows import read_stage_metrics
from evonav.evaluation.records import costs
from evonav.evaluation.records.schema import RoundRecord, StageRecord
from evonav.evaluation.records.store import RunStore
from evonav.parallel.folders import replacing

FORMULA_STARTS = ("=", "+", "-", "@", "\t", "\r")
"""Characters that a spreadsheet takes for the start of a formula."""
_ROUND: tuple[tuple[str, str, str, Callable[[StageRecord, RoundRecord], Any]], ...] = (
    ("agent", "str", "Name of the agent, as the run was started with it.", lambda stage, _: stage.agent),
    ("task_id", "str", "Id of the task.", lambda stage, _: stage.task_id),
    ("stage", "int", "Number of the stage, from 1.", lambda stage, _: stage.stage),
    ("round", "int", "Number of the round, from 0.", lambda _, one: one.round),
    ("x_m", "float", "Position of the agent when it observed.", lambda _, one: one.pose.x_m),
    ("z_m", "float", "As `x_m`; AI2-THOR's world frame.", lambda _, one: one.pose.z_m),
    ("yaw_rad", "float", "Clockwise from +z, seen from above.", lambda _, one: one.pose.yaw_rad),
    ("action", "str", "`move`, `navigate_to` or `stop`.", lambda _, one: one.action.kind),
    ("target_x_m", "float", "Target of a `navigate_to`.", lambda _, one: _target(one)[0]),
    ("target_z_m", "float", "Target of a `navigate_to`.", lambda _, one: _target(one)[1]),
    ("is_action_success", "bool", "True if the action could be carried out.", lambda _, one: one.is_action_success),
    (
        "is_target_visible",
        "bool",
        "True if the target was in one of the round's views.",
        lambda _, one: one.is_target_visible,
    ),
    (
        "choice",
        "str",
        "The agent's name for its choice: `object 12`, `frontier 3`, `none`.",
        lambda _, one: one.choice,
    ),
    ("chosen_label", "str", "Label of the entry that was chosen.", lambda _, one: _chosen(one, "label")),
    ("is_chosen_stale", "bool", "True if no object of that label was there.", lambda _, one: _chosen(one, "is_stale")),
    ("num_entries", "int", "Number of entries in the agent's memory.", lambda _, one: one.num_entries),
    (
        "num_frontiers",
        "int",
        "Number of frontiers that the agent could choose from.",
        lambda _, one: one.num_frontiers,
    ),
)
"""Columns of a table of rounds: name, type, description, and value of a round of a stage."""
ROUND_COLUMNS = {name: description for name, _, description, _ in _ROUND}
"""Columns of a table of rounds, and their descriptions."""
ROWS_PER_BLOCK = 20_000
"""Rows of a Parquet file that are in memory at a time."""
_ARROW = {"str": "string", "bool": "bool_", "int": "int64", "float": "float64"}


def stage_columns() -> dict[str, str]:
    """Return the columns of a table of stages and their descriptions: the fields of `StageMetrics`."""
    descriptions = {**_field_docstrings(costs), **_field_docstrings(metrics)}
    return {field.name: descriptions.get(field.name, "") for field in fields(StageMetrics)}


def stage_table(run_dir: Path, agents: Sequence[str] | None = None) -> list[dict[str, Any]]:
    """Return one row per recorded stage, by agent, task and stage.

    Raises:
        StoreError: The run cannot be read.
    """
    with RunStore(run_dir) as store:
        return [asdict(row) for row in read_stage_metrics(store, agents)]


def round_table(run_dir: Path, agents: Sequence[str] | None = None) -> Iterator[dict[str, Any]]:
    """Yield one row per decision round, with whole traces: one stage is read at a time.

    Raises:
        StoreError: The run cannot be read.
    """
    with RunStore(run_dir) as store:
        for agent in agents if agents is not None else (None,):
            for record in store.records(agent):
                for one in record.trace:
                    yield {name: value(record, one) for name, _, _, value in _ROUND}


def _target(one: RoundRecord) -> tuple[float | None, float | None]:
    return one.action.position_m if one.action.kind == "navigate_to" else (None, None)


def _chosen(one: RoundRecord, field: str) -> Any:  # noqa: ANN401 - a field of the entry
    return None if one.chosen_entry is None else getattr(one.chosen_entry, field)


def write_table(rows: Iterable[dict[str, Any]], columns: dict[str, str], path: Path) -> Path:
    """Write rows in the format of the file's suffix: `.csv`, `.jsonl` or `.parquet`.

    Args:
        rows: Rows that all have these columns.
        columns: Columns with their descriptions, which Parquet stores.
        path: File to write; its folder is made.

    Raises:
        StoreError: The suffix is none of these, pyarrow is not installed, or the file cannot be written.
    """
    writers = {".csv": _write_csv, ".jsonl": _write_jsonl, ".parquet": _write_parquet}
    if path.suffix not in writers:
        raise StoreError(f"{path}: expected a file {', '.join(writers)}")
    with replacing(path) as beside:
        writers[path.suffix](rows, columns, beside)
    return path


def _write_csv(rows: Iterable[dict[str, Any]], columns: dict[str, str], path: Path) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows([csv_cell(row[name]) for name in columns] for row in rows)


def _write_jsonl(rows: Iterable[dict[str, Any]], columns: dict[str, str], path: Path) -> None:
    with path.open("w", encoding="utf-8") as file:
        for row in rows:
            file.write(json.dumps({name: row[name] for name in columns}, allow_nan=False) + "\n")


def _write_parquet(rows: Iterable[dict[str, Any]], columns: dict[str, str], path: Path) -> None:
    pyarrow = optional_module("pyarrow", "Parquet needs pyarrow", "'evonav[data]'")
    parquet = optional_module("pyarrow.parquet", "Parquet needs pyarrow", "'evonav[data]'")
    kinds = {**_kinds(StageMetrics), **{name: kind for name, kind, _, _ in _ROUND}}
    schema = pyarrow.schema(
        [
            pyarrow.field(name, getattr(pyarrow, _ARROW[kinds[name]])(), metadata={"description": description})
            for name, description in columns.items()
        ],
        metadata={"evonav": "one row a stage or round; docs/metrics.md"},
    )
    with parquet.ParquetWriter(path, schema) as writer:
        left = iter(rows)
        while block := list(islice(left, ROWS_PER_BLOCK)):
            writer.write_table(
                pyarrow.Table.from_pylist([{name: row[name] for name in columns} for row in block], schema)
            )


def _kinds(kind: type) -> dict[str, str]:
    """Plain type of every field: `float` for `float | None`."""
    found = {}
    for field in fields(kind):
        name = field.type if isinstance(field.type, str) else getattr(field.type, "__name__", str(field.type))
        text = str(field.type) if "|" in str(field.type) else name
        found[field.name] = next(plain for plain in ("bool", "str", "float", "int") if plain in text)
    return found


def _field_docstrings(module: Any) -> dict[str, str]:  # noqa: ANN401 - a module
    """Return the docstrings of a module's fields, by field; empty for a field without one."""
    found: dict[str, str] = {}
    for node in ast.walk(ast.parse(inspect.getsource(module))):
        if isinstance(node, ast.ClassDef):
            for one, following in zip(node.body, [*node.body[1:], ast.Pass()], strict=True):
                if isinstance(one, ast.AnnAssign) and isinstance(one.target, ast.Name):
                    has_docstring = isinstance(following, ast.Expr) and isinstance(following.value, ast.Constant)
                    text = str(following.value.value) if has_docstring else ""  # type: ignore[attr-defined]
                    found[one.target.id] = text
    return {name: " ".join(text.split()) for name, text in found.items()}


def csv_text(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return a CSV file: numbers unrounded, empty for `None`, `true` and `false`, and no text that starts a formula."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow([csv_cell(column) for column in columns])
    for row in rows:
        writer.writerow([csv_cell(value) for value in row])
    return out.getvalue()


def csv_cell(value: object) -> str:
    """Return a value as a cell. Text that a spreadsheet would run as a formula gets an apostrophe before it."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int | float):
        return repr(value)
    text = str(value)
    return f"'{text}" if text.startswith(FORMULA_STARTS) else text
