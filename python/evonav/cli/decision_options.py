"""Options on who answers the agents' questions, shared by the commands that run agents."""

import inspect
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from enum import Enum
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

if TYPE_CHECKING:  # the command must start fast
    from collections.abc import Sequence

    from evonav.decision.account import Price
    from evonav.evaluation.backend import Backend
    from evonav.evaluation.engine import RunConfig, TaskFile

MODEL_VARIABLE = "EVONAV_VLM_MODEL"
EXCHANGES_NAME = "exchanges.sqlite"
"""In the folder of a run."""
VLM_STAGE_TIMEOUT_S = 4 * 3600.0
"""50 rounds of three questions, each answered in a minute and asked again once or twice."""


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
        Path | None, _option(f"SQLite file of questions and answers. Default: {EXCHANGES_NAME} in OUT.")
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


def with_decisions(
    backend: "Backend", options: DecisionOptions, *, out: Path, seed: int, num_workers: int
) -> "Backend":
    """A backend whose agents ask what the options say; it is tried before the run begins.

    Raises:
        InvalidArgumentError: An option makes no sense.
        DecisionError: The model cannot be asked from here: no key, no package.
        StoreError: The exchanges cannot be opened.
    """
    noise = _noise(options.noise)
    if options.decision == "text":
        _refuse_model_options(options)
        return replace(backend, decision_options=noise)
    if options.decision != "vlm" and ":" not in options.decision:
        raise typer.BadParameter(f"--decision {options.decision}: expected text, vlm or module:name")
    if options.dry_run:
        if options.decision != "vlm":
            raise typer.BadParameter("--dry-run is for --decision vlm")
        return replace(backend, decision_options={**_vlm_identity(options, seed), **noise})
    asked = _vlm(options, out, seed, num_workers) if options.decision == "vlm" else _own(options, out)
    path, identity, host = asked
    asking = replace(backend, decision=path, decision_options={**identity, **noise}, decision_host_options=host)
    check = getattr(asking.make_decision(seed), "check", None)
    if check is not None:
        check()
    return asking


def stage_timeout_s(options: DecisionOptions, default_s: float) -> float:
    """How long a stage may take: models take their time."""
    return default_s if options.decision == "text" else VLM_STAGE_TIMEOUT_S


def answer_timeout_s(options: DecisionOptions) -> float:
    """How long an agent may take for a round: a model that is asked several times in it takes its time."""
    return 600.0 if options.decision == "text" else 3600.0


def _noise(text: str) -> dict[str, Any]:
    """The option, read and checked; nothing where nothing is to go wrong."""
    if not text:
        return {}
    from evonav.decision.noisy import NoiseRates
    from evonav.decision.rates import read_rates

    rates = read_rates(text, [field.name for field in fields(NoiseRates)])
    NoiseRates.read(rates)
    return {"noise": rates}


def _refuse_model_options(options: DecisionOptions, *allowed: str) -> None:
    """Says of options that would be overlooked that they are; the model may come from the environment."""
    default = DecisionOptions()
    for field in fields(DecisionOptions):
        is_given = getattr(options, field.name) != getattr(default, field.name)
        if is_given and field.name not in ("decision", "model", "noise", *allowed):
            raise typer.BadParameter(
                f"--{field.name.replace('_', '-')} is of no use with --decision {options.decision}"
            )


def _vlm(
    options: DecisionOptions, out: Path, seed: int, num_workers: int
) -> tuple[str, dict[str, Any], dict[str, Any]]:
    """A model behind an endpoint: what makes it, what it is, and how it is reached."""
    server = _given(
        base_url=options.base_url,
        timeout_s=options.request_timeout,
        max_retries=options.max_retries,
        # Each process keeps to its share of what the run may ask.
        requests_per_minute=_share(options.requests_per_minute, num_workers),
        tokens_per_minute=_share(options.tokens_per_minute, num_workers),
    )
    identity = _vlm_identity(options, seed)
    host = {"server": server, **_keeping(options, out), **_spending(options, identity["model"], out)}
    return "evonav.decision.backends:vlm", identity, host


def _vlm_identity(options: DecisionOptions, seed: int) -> dict[str, Any]:
    """What decides the answers of a model behind an endpoint."""
    from evonav.decision.backends import SAMPLING

    if not options.model:
        raise typer.BadParameter(f"--decision vlm needs --model (or {MODEL_VARIABLE})")
    sampling: dict[str, Any] = {**SAMPLING, "seed": seed}
    if options.reasoning:
        sampling |= {"temperature": None, "top_p": None, "max_tokens_field": "max_completion_tokens"}
    given = _given(temperature=options.temperature, top_p=options.top_p, max_tokens=options.max_tokens)
    return {
        "model": options.model,
        "structured": options.structured.value,
        "images": options.images,
        "request": {**sampling, **given},
    }


def _own(options: DecisionOptions, out: Path) -> tuple[str, dict[str, Any], dict[str, Any]]:
    """A model of the user's own."""
    from evonav.decision.ledger import LEDGER_NAME

    _refuse_model_options(options, "vlm_mode", "exchanges", "exchange_images")
    host = {**_keeping(options, out), "ledger": str((out / LEDGER_NAME).absolute())}
    return "evonav.decision.backends:own", {"path": options.decision}, host


def _keeping(options: DecisionOptions, out: Path) -> dict[str, Any]:
    """Where exchanges are kept, and what is had from there."""
    from evonav.decision.exchanges import ExchangeStore
    from evonav.errors import StoreError
    from evonav.evaluation.store import FILE_NAME

    mode = options.vlm_mode or VlmMode.AUTO
    if mode is VlmMode.LIVE:
        if options.exchanges is not None:
            raise typer.BadParameter("--vlm-mode live keeps nothing: leave --exchanges out")
        return {}
    path = options.exchanges or out / EXCHANGES_NAME
    if mode is VlmMode.REPLAY and not path.is_file():
        raise StoreError(f"{path}: no exchanges here to replay")
    store = ExchangeStore(path)
    is_new = len(store) == 0 and store.num_failures == 0
    store.close()
    if mode is VlmMode.RECORD and not is_new and not (out / FILE_NAME).exists():
        raise StoreError(f"{path}: holds exchanges already: record to a new file, or use --vlm-mode auto")
    # Agents of one run ask the same questions: the first answer has to stay, or its replay would be another run.
    kept = VlmMode.AUTO if mode is VlmMode.RECORD else mode
    return {"exchanges": str(path.absolute()), "mode": kept.value, "keeps_images": options.exchange_images}


def _spending(options: DecisionOptions, model: str, out: Path) -> dict[str, Any]:
    """Prices, limit, and where all processes of the run book."""
    from evonav.decision.ledger import LEDGER_NAME

    spending: dict[str, Any] = {"ledger": str((out / LEDGER_NAME).absolute())}
    price = _price(options, model)
    if price is not None:
        spending["price"] = [price.input_usd, price.output_usd]
    if options.max_cost is not None:
        spending["max_cost_usd"] = options.max_cost
    return spending


def _price(options: DecisionOptions, model: str) -> "Price | None":
    """Of the model, from the table given."""
    from evonav.decision.account import read_prices
    from evonav.errors import InvalidArgumentError

    if options.prices is None:
        return None
    table = read_prices(options.prices)
    if model not in table:
        raise InvalidArgumentError(f"{options.prices}: has no prices of {model!r}")
    return table[model]


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
    from evonav.decision.account import Usage
    from evonav.decision.counting import OUTPUT_TOKENS
    from evonav.evaluation.estimate import estimate_run

    price = _price(options, options.model or "")
    with progress() as show:
        estimates = estimate_run(
            agents, tasks, config, dict(config.backend.decision_options), num_workers=num_workers, on_progress=show
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
    from evonav.decision.ledger import LEDGER_NAME, Ledger

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


def _share(limit: float | None, num_workers: int) -> float | None:
    return None if limit is None else limit / max(1, num_workers)


def _given(**options: Any) -> dict[str, Any]:  # noqa: ANN401 - JSON
    return {name: value for name, value in options.items() if value is not None}
