"""`evonav tasks write`: let a model rewrite the instructions of tasks."""

from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evonav.cli.display import progress_bar
from evonav.cli.options.settings import with_settings
from evonav.cli.options.shared import EXIT_INCOMPLETE, Limit

if TYPE_CHECKING:
    from evonav.evaluation.run.settings import DecisionSettings, SpendingSettings
    from evonav.generation.instructions.writer import Writing


class VlmMode(str, Enum):
    """The source of answers."""

    LIVE = "live"
    RECORD = "record"
    REPLAY = "replay"
    AUTO = "auto"


Folder = Annotated[Path, typer.Argument(help="Folder of tasks, which are rewritten in place.")]
VlmModel = Annotated[str, typer.Option(help="Name of the model on the server.")]
VlmExchanges = Annotated[
    Path | None, typer.Option(help="SQLite file that stores questions and answers. Default: none.")
]
VlmModeOption = Annotated[
    VlmMode | None,
    typer.Option(
        help="auto asks what is not stored yet, replay never asks, record asks and stores, live stores nothing."
    ),
]
VlmWorkers = Annotated[int, typer.Option(min=1, help="Number of questions asked at the same time.")]


@with_settings("endpoint", "spending")
def write(
    folder: Folder,
    endpoint: "DecisionSettings",
    spending: "SpendingSettings",
    vlm_model: VlmModel = "gpt-4o",
    vlm_exchanges: VlmExchanges = None,
    vlm_mode: VlmModeOption = None,
    vlm_workers: VlmWorkers = 4,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Estimate the cost, and ask nothing.")] = False,
    limit: Limit = None,
) -> None:
    """Let a model write appearance and unified instructions, with the paper's prompts; run again to resume.

    The key is read from OPENAI_API_KEY.
    """
    from evonav.decision.vlm.account import Account
    from evonav.decision.vlm.client import VlmClient, VlmConfig
    from evonav.decision.vlm.response_cache import ResponseCache
    from evonav.generation.instructions.writer import estimate_texts, write_texts

    account = Account(spending.price(vlm_model), spending.max_cost)
    config = VlmConfig(vlm_model, base_url=endpoint.base_url, max_concurrency=vlm_workers)
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
    with progress_bar("tasks") as show:
        writing = write_texts(folder, client, limit=limit, on_task=lambda state: show(state.num_done, state.num_tasks))
    _tell(writing)
    cost = "" if account.cost_usd is None else f", ${account.cost_usd:.4f}"
    counts = f"{account.num_asked} questions asked, {account.num_replayed} answered from exchanges"
    typer.echo(f"{counts}; {account.usage.input_tokens} tokens in, {account.usage.output_tokens} out{cost}")
    if writing.stopped is not None:
        typer.echo(f"stopped: {writing.stopped}; run again to resume", err=True)
        raise typer.Exit(EXIT_INCOMPLETE)


def _tell(writing: "Writing") -> None:
    typer.echo(
        f"{writing.num_written} stages written, {writing.num_written_before} were before, "
        f"{writing.failures.total()} keep the describer's texts ({writing.num_done} of {writing.num_tasks} tasks)"
    )
    for kind, count in sorted(writing.failures.items()):
        typer.echo(f"  {kind}: {count}")
    for message in writing.messages[:5]:
        typer.echo(f"  {message}", err=True)
