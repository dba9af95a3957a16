"""Read sweep files: TOML that lists the runs to make (docs/sweeps.md).

Short forms (`tasks = ["bundled:2"]`) are expanded first, so that one model validates all files. An error is one
sentence with file, key and value.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

from pydantic import ConfigDict, Field

from evonav.errors import InvalidArgumentError
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.run.run_settings import RunSettings, SettingError, Settings, SpendingSettings, settings_of
from evonav.evaluation.run.settings import DecisionSettings, PerceptionSettings, SimulatorSettings
from evonav.sweeps.shorthand import MAX_NAME_CHARACTERS, SHORT_FORMS, listed
from evonav.tasks.records import described_schema
from evonav.tasks.subsets import SubsetError, parse_subset
from evonav.toml import key_and_value, read_toml, set_value

SEPARATOR = "__"
"""Separator between the parts of a cell's name; no part contains it."""

Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9](_?[A-Za-z0-9.-])*$", max_length=MAX_NAME_CHARACTERS)]
Seed = Annotated[int, Field(ge=0)]


class TaskSet(Settings):
    """Tasks of a folder."""

    folder: str = Field(min_length=1)
    """Holds one folder a task; `bundled`: the tasks that come with evonav."""
    limit: int | None = Field(default=None, ge=1)
    """Take the first N."""
    subset: str | None = None
    """Named subset, SPLIT-N, such as test-90."""


class Pattern(Settings):
    """Combinations of agent and cell: a name, a glob such as `noisy-*`, or a list of them, for any of the axes."""

    agent: tuple[str, ...] = ()
    simulator: tuple[str, ...] = ()
    perception: tuple[str, ...] = ()
    decision: tuple[str, ...] = ()
    tasks: tuple[str, ...] = ()
    seed: tuple[Seed, ...] = ()


class SweepFile(RunSettings, SpendingSettings):
    """A sweep: agents x simulators x perceptions x decisions x tasks x seeds."""

    model_config = ConfigDict(title="evonav sweep")

    name: str = ""
    """Name of the sweep in its summary."""
    out: str | None = None
    """Folder for runs and summary; `--out` overrides it."""
    agents: tuple[str, ...] = Field(min_length=1)
    """Names as `evonav agents` lists them, `fu@bayes` (with a forgetting rule), `./file.py:Class` or `module:Class`."""
    tasks: dict[Name, TaskSet] = Field(min_length=1)
    """Short: a list of `FOLDER`, `FOLDER:LIMIT` or `FOLDER:SUBSET`, with `bundled` for a folder."""
    simulators: dict[Name, SimulatorSettings] = Field(default={"embedded": SimulatorSettings()}, min_length=1)
    """Short: a list of embedded, ai2thor."""
    perceptions: dict[Name, PerceptionSettings] = Field(default={"gt": PerceptionSettings()}, min_length=1)
    """Short: a list of gt, noisy:PRESET, noisy:PRESET,miss_rate=0.3, predicted:STACK, module:function."""
    decisions: dict[Name, DecisionSettings] = Field(default={"text": DecisionSettings()}, min_length=1)
    """Short: a list of text, text:wrong=0.1 (with mistakes), vlm:MODEL, module:name."""
    seeds: tuple[Seed, ...] = Field(default=(0,), min_length=1)
    """Seeds of every random choice, one run each."""
    protocol: ProtocolConfig = Field(default_factory=ProtocolConfig)
    """The protocol of every run; values left out are the paper's."""
    include: tuple[Pattern, ...] = ()
    """Run only combinations that match one of these patterns. Default: all."""
    exclude: tuple[Pattern, ...] = ()
    """Do not run combinations that match one of these patterns."""


def read_sweep(path: Path, changes: Sequence[str] = ()) -> SweepFile:
    """Read a sweep file.

    Args:
        changes: `KEY=VALUE` that override the file; a key with dots names an entry of a table, a value is JSON or text.

    Raises:
        InvalidArgumentError: A value is invalid; the message names file, key and value.
    """
    raw = read_toml(path)
    for change in changes:
        set_value(raw, *key_and_value(change), str(path))
    for axis, spell in SHORT_FORMS.items():
        if axis in raw:
            raw[axis] = spell(raw[axis], f"{path}: {axis}")
    for axis in ("include", "exclude"):
        if isinstance(raw.get(axis), list):
            raw[axis] = [listed(pattern) for pattern in raw[axis]]
    with _naming(path):
        sweep = settings_of(SweepFile, raw)
    _check(sweep, path)
    return sweep.with_episodes(
        [one.kind for one in sweep.decisions.values()], [one.kind for one in sweep.simulators.values()]
    )


def sweep_schema() -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of sweep files, short forms included, for editors."""
    schema = described_schema(SweepFile)
    text_schema: dict[str, Any] = {"type": "string"}
    short: dict[str, Any] = {"anyOf": [text_schema, {"type": "array", "items": text_schema}]}
    for axis in SHORT_FORMS:
        field = schema["properties"][axis]
        long = {key: field.pop(key) for key in tuple(field) if key not in ("title", "description", "default")}
        for pattern, entry in long.get("patternProperties", {}).items():
            long |= {"patternProperties": {pattern: {"anyOf": [entry, text_schema]}}, "additionalProperties": False}
        field["anyOf"] = [long, *([text_schema, {"type": "integer"}] if axis == "seeds" else short["anyOf"])]
        field.pop("default", None)
    for name, field in schema["$defs"]["Pattern"]["properties"].items():
        one = {"type": "integer" if name == "seed" else "string"}
        field["anyOf"] = [{key: field.pop(key) for key in tuple(field) if key not in ("title", "default")}, one]
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


@contextmanager
def _naming(path: Path, table: str = "") -> Iterator[None]:
    """Name the file, its table and the field in errors of settings."""
    try:
        yield
    except SettingError as error:
        raise InvalidArgumentError(f"{path}: {table}{'.' if table else ''}{error.key} {error.problem}") from None
    except InvalidArgumentError as error:
        raise InvalidArgumentError(f"{path}: {table}: {error}" if table else f"{path}: {error}") from None


def _check(sweep: SweepFile, path: Path) -> None:
    """Check what concerns more than one field."""
    for name, simulator in sweep.simulators.items():
        with _naming(path, f"simulators.{name}"):
            simulator.component()
    for name, decision in sweep.decisions.items():
        with _naming(path, f"decisions.{name}"):
            decision.check()
            if decision.mode == "record":
                raise SettingError(
                    DecisionSettings,
                    "mode",
                    "= 'record': is for one run; auto stores answers too, and a sweep that is resumed uses them",
                )
    for name, perception in sweep.perceptions.items():
        with _naming(path, f"perceptions.{name}"):
            perception.component()
    with _naming(path):
        sweep.workforce()
    for name, tasks in sweep.tasks.items():
        if tasks.limit is not None and tasks.subset is not None:
            raise InvalidArgumentError(f"{path}: tasks.{name}: give limit or subset, not both")
        if tasks.subset is not None:
            try:
                parse_subset(tasks.subset)
            except SubsetError as error:
                raise InvalidArgumentError(f"{path}: tasks.{name}.{error}") from None
    if sweep.max_cost is not None and sweep.prices is None:
        raise InvalidArgumentError(f"{path}: max_cost = {sweep.max_cost:g} needs prices, a table of what models cost")
    for which in ("include", "exclude"):
        for index, pattern in enumerate(getattr(sweep, which)):
            if not pattern.model_fields_set:
                raise InvalidArgumentError(f"{path}: {which}.{index} is empty: name an agent, decision, ...")
