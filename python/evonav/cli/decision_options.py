"""Options on who answers the agents' questions, shared by the commands that run agents."""

import inspect
from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import dataclass, fields
from enum import Enum
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

if TYPE_CHECKING:  # the command must start fast
    from collections.abc import Iterator, Sequence

    from evonav.component import Component
    from evonav.decision.question import DecisionModel
    from evonav.evaluation.run.run import RunConfig
    from evonav.evaluation.run.settings import DecisionSettings
    from evonav.tasks.listing import TaskFile

MODEL_VARIABLE = "EVONAV_VLM_MODEL"
_SETTINGS = {"decision": "kind", "vlm_mode": "mode", "request_timeout": "request_timeout_s"}
"""Options whose setting has another name."""
_THOR = ("executable", "commit_id", "platform", "gpu_device", "x_display")
_PATHS = ("exchanges",)
_OF_MODELS = ("prices", "max_cost", "dry_run")
"""Options of `--decision vlm` alone that are no settings of it."""
_NO_SETTINGS = (*_OF_MODELS, "noise")


class VlmMode(str, Enum):
    """Where answers come from."""

    LIVE = "live"
    RECORD = "record"
    REPLAY = "replay"
    AUTO = "auto"


class StructuredMode(str, Enum):
    """Whether answers are held to a JSON Schema."""

    AUTO = "auto"
    ON = "on"
    OFF = "off"


def _option(help_: str, **settings: Any) -> Any:  # noqa: ANN401 - typer's
    return typer.Option(help=help_, rich_help_panel="Decisions", **settings)


@dataclass(frozen=True)
class DecisionOptions:
    """What was said on the command line."""

    decision: Annotated[
        str, _option("Who answers the agents' questions: text (rules), vlm (a model), or module:name (your own).")
    ] = "text"
    model: Annotated[str | None, _option("vlm: the model's name, as the server calls it.", envvar=MODEL_VARIABLE)] = (
        None
    )
    base_url: Annotated[
        str | None, _option("vlm: of an OpenAI-compatible API, with its /v1. Default: OPENAI_BASE_URL, else OpenAI's.")
    ] = None
    vlm_mode: Annotated[
        VlmMode | None,
        _option(
            "auto (default) asks what is not kept; replay never asks; record wants a new file; live keeps nothing."
        ),
    ] = None
    exchanges: Annotated[
        Path | None, _option("SQLite file of questions and answers. Default: exchanges.sqlite in OUT.")
    ] = None
    exchange_images: Annotated[bool, _option("Keep the images of exchanges too.")] = True
    prices: Annotated[
        Path | None, _option('JSON: {"MODEL": {"input_usd": .., "output_usd": ..}}, dollars a million tokens.')
    ] = None
    max_cost: Annotated[float | None, _option("Dollars that the run may spend in all; needs --prices.")] = None
    temperature: Annotated[float | None, _option("vlm: default 0.7.")] = None
    top_p: Annotated[float | None, _option("vlm: default 0.95.")] = None
    max_tokens: Annotated[int | None, _option("vlm: of an answer; default 4096.")] = None
    reasoning: Annotated[
        bool,
        _option("vlm: the model knows max_completion_tokens alone, and no temperature, as OpenAI's that think first."),
    ] = False
    structured: Annotated[
        StructuredMode, _option("vlm: JSON by schema; auto: until the server says that it cannot.")
    ] = StructuredMode.AUTO
    images: Annotated[bool, _option("vlm: show the model images.")] = True
    requests_per_minute: Annotated[float | None, _option("vlm: of the run, spread over its workers.")] = None
    tokens_per_minute: Annotated[float | None, _option("vlm: of the run, spread over its workers.")] = None
    request_timeout: Annotated[float | None, _option("vlm: seconds for a try; default 60.")] = None
    max_retries: Annotated[int | None, _option("vlm: of lost connections, 429 and 5xx; default 4.")] = None
    noise: Annotated[
        str, _option("Mistakes on purpose, as shares: wrong=0.1,unparsable=0.05,refusal=0.02,lost=0.01; delay=SECONDS.")
    ] = ""
    dry_run: Annotated[
        bool,
        _option("vlm: say what the run would cost, from a few tasks with the text matcher; ask nothing."),
    ] = False


def with_decision_options(command: Callable[..., None]) -> Callable[..., None]:
    """Gives a command with a parameter `decisions` an option for each field of `DecisionOptions`."""
    hints = get_type_hints(DecisionOptions, include_extras=True)
    spread = [
        inspect.Parameter(
            field.name, inspect.Parameter.KEYWORD_ONLY, default=field.default, annotation=hints[field.name]
        )
        for field in fields(DecisionOptions)
        for hint in (hints[field.name],)
    ]

    @wraps(command)
    def spread_out(**given: Any) -> None:  # noqa: ANN401 - typer's
        decisions = DecisionOptions(**{field.name: given.pop(field.name) for field in fields(DecisionOptions)})
        command(**given, decisions=decisions)

    own_hints = get_type_hints(command, include_extras=True)
    own = [
        parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY, annotation=own_hints[name])
        for name, parameter in inspect.signature(command).parameters.items()
        if name != "decisions"
    ]
    spread_out.__signature__ = inspect.Signature([*own, *spread])  # type: ignore[attr-defined]
    spread_out.__annotations__ = {parameter.name: parameter.annotation for parameter in [*own, *spread]}
    return spread_out


def decision_settings(options: DecisionOptions) -> "DecisionSettings":
    """The options as settings, checked.

    Raises:
        InvalidArgumentError: Rates of mistakes make no sense.
    """
    from evonav.decision.noisy import NoiseRates
    from evonav.decision.rates import read_rates
    from evonav.errors import InvalidArgumentError
    from evonav.evaluation.run.settings import DecisionSettings

    default = DecisionOptions()
    given: dict[str, Any] = {
        _SETTINGS.get(name, name): value.value if isinstance(value, Enum) else str(value) if name in _PATHS else value
        for name in (field.name for field in fields(DecisionOptions) if field.name not in _NO_SETTINGS)
        if (value := getattr(options, name)) != getattr(default, name)
    }
    try:
        noise = read_rates(options.noise, [field.name for field in fields(NoiseRates)])
    except InvalidArgumentError as error:
        raise typer.BadParameter(f"--noise {error}") from None
    settings = DecisionSettings.model_validate({**given, "noise": noise})
    with spelled_as_options():
        settings.check()
    if options.decision != "vlm":
        for name in _OF_MODELS:
            if getattr(options, name) != getattr(default, name):
                raise typer.BadParameter(f"--{name.replace('_', '-')} is for --decision vlm")
    return settings


def decision_component(
    options: DecisionOptions, *, out: Path, seed: int, num_workers: int
) -> "Component[DecisionModel]":
    """Return how to build the decision model of the options, after a check that it can be asked from here.

    Raises:
        InvalidArgumentError: An option makes no sense.
        DecisionError: The model cannot be asked from here: no key, no package.
        StoreError: The exchanges cannot be opened.
    """
    from evonav.evaluation.run.settings import Books, SpendingSettings, try_decisions

    settings = decision_settings(options)
    spending = SpendingSettings(options.prices, options.max_cost)
    books = None if options.dry_run else Books.of_run(out, spending, num_workers)
    with spelled_as_options():
        decision = settings.component(seed, books)
    if books is not None and settings.kind != "text":
        try_decisions(decision, seed)
    return decision


@contextmanager
def spelled_as_options() -> "Iterator[None]":
    """Names the option where a setting makes no sense."""
    from evonav.evaluation.run.settings import SettingError

    options = {name: option for option, name in _SETTINGS.items()}
    options |= {name: f"thor_{name.partition('_')[0 if name != 'x_display' else 2]}" for name in _THOR}
    try:
        yield
    except SettingError as error:
        option = options.get(error.key, error.key).replace("_", "-")
        raise typer.BadParameter(f"--{option} {error.said}") from None


def print_estimate(
    options: DecisionOptions,
    agents: "Sequence[str]",
    tasks: "Sequence[TaskFile]",
    config: "RunConfig",
    num_workers: int,
) -> None:
    """What a run would ask and cost, from a few of its tasks."""
    from rich.console import Console
    from rich.table import Table

    from evonav.cli.display import progress
    from evonav.decision.vlm.account import Usage
    from evonav.decision.vlm.counting import OUTPUT_TOKENS
    from evonav.evaluation.run.cost_estimate import estimate_run
    from evonav.evaluation.run.settings import SpendingSettings

    price = SpendingSettings(options.prices).price(options.model or "")
    with progress() as show:
        estimates = estimate_run(
            agents, tasks, config, dict(config.backend.decision.options), num_workers=num_workers, on_progress=show
        )
    first = estimates[0]
    table = Table(title=f"{first.num_stages} stages, by {first.num_stages_run} of them with the text matcher")
    for heading in ("agent", "requests", "by kind", "tokens in", "95%", "tokens out", "dollars"):
        table.add_column(heading, justify="left" if heading in ("agent", "by kind") else "right")
    for found in estimates:
        kinds = ", ".join(f"{kind} {count:.0f}" for kind, count in found.kinds.items())
        error = "?" if found.relative_error == float("inf") else f"+-{100 * found.relative_error:.0f}%"
        usage = Usage(int(found.input_tokens), int(found.output_tokens))
        cost = "?" if price is None else f"{price.of(usage):.2f}"
        figures = (f"{found.num_requests:.0f}", kinds, f"{found.input_tokens:.0f}", error, f"{found.output_tokens:.0f}")
        table.add_row(found.agent, *figures, cost)
    Console().print(table)
    typer.echo(
        f"Tokens in: images as gpt-4o counts them, 3 characters of text a token; rather too many. Out: {OUTPUT_TOKENS} "
        "an answer, assumed. The interval is over tasks; a model that decides otherwise is asked more or less often."
    )


def print_spending(out: Path) -> None:
    """What the models of a run were asked and paid, over all its calls."""
    from evonav.decision.vlm.ledger import LEDGER_NAME, Ledger

    path = out / LEDGER_NAME
    if not path.is_file():
        return
    for spent in Ledger(path).spending():
        lost = f" ({spent.num_without_answer} without an answer)" if spent.num_without_answer else ""
        cost = f", ${spent.cost_usd:.4f}" if spent.cost_usd else ""
        aside = f", and ${spent.set_aside_usd:.4f} set aside" if spent.set_aside_usd > 1e-9 else ""
        typer.echo(
            f"{spent.model}: {spent.num_asked} questions asked{lost}, {spent.num_replayed} answered from exchanges; "
            f"{spent.input_tokens} tokens in, {spent.output_tokens} out{cost}{aside}"
        )
