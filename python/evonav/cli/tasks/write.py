"""`tasks write`: a model's words in place of the describer's."""

from contextlib import contextmanager
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evonav.cli.options.shared import Limit

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from evonav.generation.instructions.writer import Writing

EXIT_INCOMPLETE = 3


class VlmMode(str, Enum):
    """Where answers come from."""

    LIVE = "live"
    RECORD = "record"
    REPLAY = "replay"
    AUTO = "auto"


Folder = Annotated[Path, typer.Argument(help="Folder of tasks; they are rewritten in place.")]
VlmModel = Annotated[str, typer.Option(help="The model's name, as the server calls it.")]
VlmBaseUrl = Annotated[
    str | None, typer.Option(help="Of an OpenAI-compatible API, with its /v1. Default: OPENAI_BASE_URL, else OpenAI's.")
]
VlmExchanges = Annotated[Path | None, typer.Option(help="SQLite file of questions and answers, to be had again.")]
VlmModeOption = Annotated[
    VlmMode | None,
    typer.Option(help="live keeps nothing, record asks and keeps, replay never asks, auto asks what is not kept."),
]
VlmWorkers = Annotated[int, typer.Option(min=1, help="Questions at a time.")]
Prices = Annotated[
    Path | None, typer.Option(help='JSON: {"MODEL": {"input_usd": .., "output_usd": ..}}, dollars a million tokens.')
]
MaxCost = Annotated[float | None, typer.Option(help="Dollars after which no more is asked; needs --prices.")]


def write(
    folder: Folder,
    vlm_model: VlmModel = "gpt-4o",
    vlm_base_url: VlmBaseUrl = None,
    vlm_exchanges: VlmExchanges = None,
    vlm_mode: VlmModeOption = None,
    vlm_workers: VlmWorkers = 4,
    prices: Prices = None,
    max_cost: MaxCost = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Say what it would cost, and ask nothing.")] = False,
    limit: Limit = None,
) -> None:
    """Has a model write appearance and unified instructions, with the paper's prompts.

    The key is read from OPENAI_API_KEY. An interrupted pass goes on where it was when it is started again.
    """
    from evonav.decision.vlm.account import Account, read_prices
    from evonav.decision.vlm.client import VlmClient, VlmConfig
    from evonav.decision.vlm.response_cache import ResponseCache
    from evonav.errors import InvalidArgumentError
    from evonav.generation.instructions.writer import estimate_texts, write_texts

    table = {} if prices is None else read_prices(prices)
    if prices is not None and vlm_model not in table:
        raise InvalidArgumentError(f"{prices}: has no prices of {vlm_model!r}")
    account = Account(table.get(vlm_model), max_cost)
    config = VlmConfig(vlm_model, base_url=vlm_base_url, max_concurrency=vlm_workers)
    store = None if vlm_exchanges is None else ResponseCache(vlm_exchanges)
    client = VlmClient(config, store=store, mode=None if vlm_mode is None else vlm_mode.value, account=account)
    if dry_run:
        estimate = estimate_texts(folder, client, limit=limit)
        cost = "" if account.price is None else f", ${account.price.of(estimate.usage):.2f}"
        num_left = estimate.num_questions - estimate.num_cached
        counts = f"{estimate.num_cached} answered by the cache; {num_left} to ask"
        typer.echo(f"{estimate.num_questions} questions, {counts}:")
        typer.echo(f"at most {estimate.usage.input_tokens} tokens in, {estimate.usage.output_tokens} out{cost}")
        return
    with _bar() as on_task:
        writing = write_texts(folder, client, limit=limit, on_task=on_task)
    _tell(writing)
    cost = "" if account.cost_usd is None else f", ${account.cost_usd:.4f}"
    counts = f"{account.num_asked} questions asked, {account.num_replayed} answered from exchanges"
    typer.echo(f"{counts}; {account.usage.input_tokens} tokens in, {account.usage.output_tokens} out{cost}")
    if writing.stopped is not None:
        typer.echo(f"stopped: {writing.stopped}; start again to go on", err=True)
        raise typer.Exit(EXIT_INCOMPLETE)


@contextmanager
def _bar() -> "Iterator[Callable[[Writing], None]]":
    """A bar over tasks."""
    from rich import progress as bars
    from rich.console import Console

    columns = (bars.TextColumn("tasks"), bars.BarColumn(), bars.MofNCompleteColumn(), bars.TimeRemainingColumn())
    with bars.Progress(*columns, console=Console(stderr=True)) as bar:
        tasks = bar.add_task("tasks")
        yield lambda news: bar.update(tasks, completed=news.num_done, total=news.num_tasks)


def _tell(writing: "Writing") -> None:
    typer.echo(
        f"{writing.num_written} stages written, {writing.num_written_before} were before, "
        f"{writing.failures.total()} keep the describer's texts ({writing.num_done} of {writing.num_tasks} tasks)"
    )
    for kind, count in sorted(writing.failures.items()):
        typer.echo(f"  {kind}: {count}")
    for message in writing.messages[:5]:
        typer.echo(f"  {message}", err=True)
