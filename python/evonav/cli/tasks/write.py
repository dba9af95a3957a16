"""`evonav tasks write`: let a model rewrite the instructions of tasks."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evonav.cli.display import progress_bar
from evonav.cli.options.decisions import DryRun
from evonav.cli.options.settings import BaseUrl, MaxCost, Model, Prices, set_option, settings_from
from evonav.cli.options.shared import EXIT_INCOMPLETE, Limit
from evonav.counted import counted

if TYPE_CHECKING:
    from evonav.generation.instructions.writer import Writing

KEYS = ("decision.mode", "decision.exchanges", "decision.images")
"""The keys that `--set` takes."""
Folder = Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder of tasks, which are rewritten in place.")]
Concurrency = Annotated[int, typer.Option(min=1, metavar="N", help="Number of questions asked at the same time.")]


def write(
    folder: Folder,
    limit: Limit = None,
    concurrency: Concurrency = 4,
    set_: Annotated[list[str] | None, set_option(*KEYS)] = None,
    model: Model = None,
    base_url: BaseUrl = None,
    prices: Prices = None,
    max_cost: MaxCost = None,
    dry_run: DryRun = False,
) -> None:
    """Let a model rewrite instructions; run again to resume.

    With the paper's prompts, it describes how goals look and merges the parts of each instruction. With
    `--set decision.images=false` it only merges them. The key is read from OPENAI_API_KEY.
    """
    from evonav.decision.vlm.account import Account
    from evonav.decision.vlm.caching_client import ResponseCache
    from evonav.decision.vlm.client import VlmClient, VlmConfig
    from evonav.generation.instructions.writer import estimate_texts, write_texts

    given = {"decision.model": model, "decision.base_url": base_url, "prices": prices, "max_cost": max_cost}
    settings = settings_from(given, set_, KEYS)
    endpoint, name = settings.decision, settings.decision.named_model()
    account = Account(settings.price(name), settings.max_cost)
    config = VlmConfig(name, base_url=endpoint.base_url, max_concurrency=concurrency)
    store = None if endpoint.exchanges is None else ResponseCache(Path(endpoint.exchanges))
    client = VlmClient(config, store=store, mode=endpoint.mode, account=account)
    if dry_run:
        estimate = estimate_texts(folder, client, images=endpoint.images, limit=limit)
        cost = "" if account.price is None else f", ${account.price.of(estimate.usage):.2f}"
        num_left = estimate.num_questions - estimate.num_cached
        counts = f"{estimate.num_cached} answered by the cache; {num_left} to ask"
        typer.echo(f"{counted(estimate.num_questions, 'question')}, {counts}:")
        typer.echo(f"at most {estimate.usage.input_tokens} tokens in, {estimate.usage.output_tokens} out{cost}")
        return
    with progress_bar("tasks") as show:
        writing = write_texts(
            folder,
            client,
            images=endpoint.images,
            limit=limit,
            on_task=lambda state: show(state.num_done, state.num_tasks),
        )
    _tell(writing)
    cost = "" if account.cost_usd is None else f", ${account.cost_usd:.4f}"
    counts = f"{counted(account.num_asked, 'question')} asked, {account.num_replayed} answered from exchanges"
    typer.echo(f"{counts}; {account.usage.input_tokens} tokens in, {account.usage.output_tokens} out{cost}")
    if writing.stopped is not None:
        typer.echo(f"stopped: {writing.stopped}; run again to resume", err=True)
        raise typer.Exit(EXIT_INCOMPLETE)


def _tell(writing: "Writing") -> None:
    typer.echo(
        f"{counted(writing.num_written, 'stage')} written, {writing.num_written_before} written before, "
        f"{writing.failures.total()} keep the texts that they had ({writing.num_done} of {writing.num_tasks} tasks)"
    )
    for kind, count in sorted(writing.failures.items()):
        typer.echo(f"  {kind}: {count}")
    for message in writing.messages[:5]:
        typer.echo(f"  {message}", err=True)
