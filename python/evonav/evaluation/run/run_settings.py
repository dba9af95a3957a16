"""Define what all settings are and how they are read; the settings of a run's workers, limits, retries and costs.

Small commands use these: nothing heavy is imported here.
"""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, get_args

from pydantic import Field, ValidationError

from evonav.decision.vlm.account import LEDGER_NAME
from evonav.errors import InvalidArgumentError
from evonav.evaluation.hosting.isolation import IS_SUPPORTED, AgentHosting, Isolation, usual_isolation
from evonav.evaluation.protocol import ProtocolConfig
from evonav.parallel.local import num_cores
from evonav.parallel.worker import EngineName, Workforce
from evonav.records import Record, wrong_value

if TYPE_CHECKING:
    from evonav.decision.vlm.account import Price
    from evonav.evaluation.run.components import Backend
    from evonav.evaluation.run.run import RunConfig

NUM_RETRIES = 2
"""Number of retries of a stage that lost its worker, its simulator or its agent's process."""
VLM_EPISODES_AT_ONCE = 16
"""Episodes that a worker runs at once where a server is asked, which takes most of the time."""

_UNKNOWN = ("extra_forbidden", "unexpected_keyword_argument")
"""Pydantic's types of errors for a key that a model, or a dataclass, does not have."""

SettingsT = TypeVar("SettingsT", bound="Settings")
RunSettingsT = TypeVar("RunSettingsT", bound="RunSettings")


class SettingError(InvalidArgumentError):
    """A setting that is invalid beside the others; the command and sweep files add its full name."""

    def __init__(self, settings: "type[Settings]", key: str, problem: str) -> None:
        """Create the error.

        Args:
            key: A field of the settings; dots reach into settings that are fields.
            problem: The problem, as the end of a sentence that begins with the field's name.
        """
        super().__init__(f"{key} {problem}")
        self.settings = settings
        self.key = key
        self.problem = problem


class Settings(Record):
    """Options that people write, in a file or on the command line.

    The string below a field is its description in the JSON Schema of sweep files and in the list of keys.
    """


def settings_of(model: type[SettingsT], raw: Mapping[str, Any]) -> SettingsT:
    """Return settings from plain values, as a file or options give them.

    Raises:
        SettingError: A key is unknown or missing, or a value invalid.
    """
    try:
        text = json.dumps(raw, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise InvalidArgumentError(f"holds a value that is no text, number, list or table: {error}") from None
    try:
        return model.model_validate_json(text)
    except ValidationError as error:
        raise _first_problem(model, error) from None


def keys_of(model: type[Settings]) -> Iterator[str]:
    """Yield the keys of settings, those of settings that are fields with a dot."""
    for name, field in model.model_fields.items():
        if isinstance(field.annotation, type) and issubclass(field.annotation, Settings):
            yield from (f"{name}.{key}" for key in keys_of(field.annotation))
        elif isinstance(field.annotation, type) and is_dataclass(field.annotation):
            yield from (f"{name}.{key.name}" for key in fields(field.annotation))
        else:
            yield name


def unknown_key(model: type[Settings], key: str, known: Sequence[str], hint: str = "") -> SettingError:
    """Return the error of a key that there is not, with the nearest one that there is.

    Args:
        hint: End of the message if no key is near; default: the keys that there are.
    """
    last = key.rpartition(".")[2]
    near = [one for one in known if one.rpartition(".")[2] == last] or get_close_matches(key, known, 1)
    near = near or [one for one in known if get_close_matches(last, [one.rpartition(".")[2]])]
    hint = f"did you mean {near[0]}?" if near else hint or f"there are {', '.join(known)}"
    return SettingError(model, key, f"is no such key; {hint}")


def _first_problem(model: type[Settings], error: ValidationError) -> SettingError:
    found = error.errors(include_url=False, include_context=True)
    # A key that nobody knows explains what is missing.
    first = next((one for one in found if one["type"] in _UNKNOWN), found[0])
    key = ".".join(str(part) for part in first["loc"] if part != "[key]")
    more = f" (and {len(found) - 1} more)" if len(found) > 1 else ""
    if first["type"] in _UNKNOWN:
        before = "".join(f"{part}." for part in first["loc"][:-1])
        unknown = unknown_key(model, key, [f"{before}{name}" for name in _names_at(model, first["loc"])])
        return SettingError(model, key, f"{unknown.problem}{more}")
    if first["type"] == "missing":
        return SettingError(model, key, f"is missing{more}")
    if first["type"] == "string_pattern_mismatch" and "[key]" in first["loc"]:
        rule = "is no name: letters, digits, '.', '-' and single '_', and the first is a letter or digit"
        return SettingError(model, key, f"{rule}{more}")
    problem = wrong_value(key, first.get("input"), first["msg"]).removeprefix(f"{key} ")
    return SettingError(model, key, f"{problem}{more}")


def _names_at(model: type[Settings], place: Sequence[int | str]) -> list[str]:
    """Return the keys of the settings, or of the dataclass, that a place of an error is in."""
    for part in place[:-1]:
        if part in model.model_fields:
            found = next(_models_in(model.model_fields[str(part)].annotation), model)
            if is_dataclass(found):
                return [field.name for field in fields(found)]
            model = found
    return [*model.model_fields]


def _models_in(annotation: Any) -> Iterator[Any]:  # noqa: ANN401 - a type hint
    if isinstance(annotation, type) and (issubclass(annotation, Settings) or is_dataclass(annotation)):
        yield annotation
    for part in get_args(annotation):
        yield from _models_in(part)


class RunSettings(Settings):
    """The workers of a run, the limits of its agents, and its retries; none of it decides records."""

    workers: int | None = Field(default=None, ge=0)
    """Number of worker processes; 0 runs in this process. Default: one per core."""
    episodes_at_once: int | None = Field(default=None, ge=1, le=1000)
    """Number of episodes that each worker runs at once, so that one computes while others wait for a model.
    Default: 1, with a VLM 16."""
    engine: EngineName = "local"
    """Run workers as local processes or as Ray actors."""
    ray_address: str | None = None
    """Ray: address of a cluster that shares this file system. Default: start Ray on this machine."""
    worker_gpus: float = Field(default=0.0, ge=0.0)
    """Ray: GPUs reserved for each worker, such as 0.5, for perception that needs one."""
    num_retries: int = Field(default=NUM_RETRIES, ge=0)
    """Number of retries of a stage that lost its worker, simulator or agent process."""
    isolation: Isolation | None = None
    """The process of agents: the evaluator's, their own, or their own without files of tasks and network (Linux).
    Default: sandbox where this machine has one, else process."""
    stage_timeout_s: float | None = Field(default=None, gt=0.0)
    """Seconds before a stage is errored. Default: 900, with a VLM 14400."""
    agent_timeout_s: float | None = Field(default=None, ge=0.1)
    """Seconds to wait for an agent's answer before its stage is errored. Default: 600, with a VLM 3600."""
    agent_memory_mb: int | None = Field(default=None, ge=256)
    """Largest address space of an agent's process, in MB. Default: no limit."""

    @property
    def num_workers(self) -> int:
        """The number of workers: the given one, or one per core."""
        return num_cores() if self.workers is None else self.workers

    @property
    def num_episodes(self) -> int:
        """Number of episodes that are run at once, 1 or more; 1 a worker before `with_episodes`."""
        return max(1, self.num_workers) * (self.episodes_at_once or 1)

    def with_episodes(self: RunSettingsT, decisions: Iterable[str], simulators: Iterable[str]) -> RunSettingsT:
        """Return these settings with a number of episodes at once: the given one, or the default.

        Args:
            decisions: Kinds of the decision models that these workers use.
            simulators: Kinds of their simulators; AI2-THOR's has a process for each episode: one runs by default.
        """
        if self.episodes_at_once is not None:
            return self
        waits = "vlm" in decisions
        is_light = set(simulators) == {"embedded"}
        has_processes = IS_SUPPORTED and self.num_workers > 0 and self.isolation != "none"
        number = VLM_EPISODES_AT_ONCE if waits and is_light and has_processes else 1
        return self.model_copy(update={"episodes_at_once": number})

    def workforce(self) -> Workforce:
        """Return the workers.

        Raises:
            SettingError: An option is of Ray, and the workers are not; or agents without processes of their own are to
                run several episodes at once.
            InvalidArgumentError: There are too few workers.
        """
        for key in ("ray_address", "worker_gpus"):
            if getattr(self, key) and self.engine != "ray":
                raise SettingError(type(self), key, "is for engine ray")
        at_once = self.episodes_at_once or 1
        if at_once > 1 and (self.num_workers == 0 or self.isolation == "none"):
            reason = f"{at_once}: needs workers, and agents in processes of their own"
            raise SettingError(type(self), "episodes_at_once", reason)
        return Workforce(
            self.num_workers, self.engine, self.ray_address, num_gpus=self.worker_gpus, jobs_at_once=at_once
        )

    def config(
        self,
        seed: int,
        backend: "Backend",
        protocol: ProtocolConfig | None = None,
        *,
        stage_timeout_s: float,
        answer_timeout_s: float,
    ) -> "RunConfig":
        """Return the configuration of a run with these limits.

        Args:
            seed: Seed of every random choice.
            backend: The parts of the run.
            protocol: Default: the paper's.
            stage_timeout_s: Limit of a stage if the settings have none.
            answer_timeout_s: Limit of an agent's answer if the settings have none.
        """
        from evonav.evaluation.run.run import RunConfig

        isolation = self.isolation or self._usual_isolation(backend)
        timeout_s = self.agent_timeout_s or answer_timeout_s
        return RunConfig(
            seed=seed,
            protocol=protocol or ProtocolConfig(),
            backend=backend,
            stage_timeout_s=self.stage_timeout_s or stage_timeout_s,
            hosting=AgentHosting(isolation, timeout_s, self.agent_memory_mb),
        )

    def _usual_isolation(self, backend: "Backend") -> Isolation:
        """Return the isolation of a run for which none is given."""
        from evonav.evaluation.hosting.model_relay import sandboxed_model_problem

        is_here = self.num_workers > 0 and self.engine == "local"
        return usual_isolation() if is_here and not sandboxed_model_problem(backend.decision) else "process"


class SpendingSettings(Settings):
    """Prices of models, and how much may be spent."""

    prices: str | None = None
    """JSON file of prices in dollars per million tokens: {"MODEL": {"input_usd": .., "output_usd": ..}}."""
    max_cost: float | None = Field(default=None, gt=0.0)
    """Largest cost in dollars; later questions fail. It needs prices. Default: no limit."""

    def price(self, model: str) -> "Price | None":
        """Return a model's price; `None` without a file of prices.

        Raises:
            InvalidArgumentError: The file cannot be read, or lacks the model.
        """
        from evonav.decision.vlm.account import read_prices

        if self.prices is None:
            return None
        table = read_prices(Path(self.prices))
        if model not in table:
            raise InvalidArgumentError(f"{self.prices}: has no prices of {model!r}")
        return table[model]

    def host_options(self, model: str) -> dict[str, Any]:
        """Return the keyword arguments of a decision model that asks `model`."""
        price = self.price(model)
        if self.max_cost is not None and price is None:
            raise SettingError(
                type(self),
                "max_cost",
                "needs the model's prices: name a file with --prices (in a sweep file: prices = ...)",
            )
        spending: dict[str, Any] = {} if price is None else {"price": [price.input_usd, price.output_usd]}
        return spending if self.max_cost is None else {**spending, "max_cost_usd": self.max_cost}


@dataclass(frozen=True, slots=True)
class DecisionResources:
    """The files in which a run stores answers of its model and logs their costs."""

    run_dir: Path
    """Folder of the run, which holds the answers unless the settings name another file."""
    spending_log: Path
    """File in which all workers log costs, of one run or of several."""
    spending: SpendingSettings
    account: str | None = None
    """Name in the spending log; default: the model's."""
    num_askers: int = 1
    """Number of episodes that may ask at once."""

    @classmethod
    def of_run(cls, run_dir: Path, spending: SpendingSettings, num_askers: int) -> "DecisionResources":
        """Return the resources of a run that has a spending log of its own."""
        return cls(run_dir, run_dir / LEDGER_NAME, spending, num_askers=num_askers)
