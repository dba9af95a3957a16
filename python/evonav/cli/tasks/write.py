"""`evonav tasks write`: let a model rewrite the instructions of tasks."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evonav.cli.display import progress_bar
from evonav.cli.options.decisions import DryRun
from evonav.cli.options.settings import with_settings
from evonav.cli.options.shared import EXIT_INCOMPLETE, Limit
from evonav.counted import counted

if TYPE_CHECKING:
    from evonav.evaluation.run.decision_resources import SpendingSettings
    from evonav.evaluation.run.settings import DecisionSettings
    from evonav.generation.instructions.writer import Writing


Folder = Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder of tasks, which are rewritten in place.")]
Concurrency = Annotated[int, typer.Option(min=1, metavar="N", help="Number of questions asked at the same time.")]


@with_settings("endpoint", "spending")
def write(
    folder: Folder,
    endpoint: "DecisionSettings",
    spending: "SpendingSettings",
    concurrency: Concurrency = 4,
    dry_run: DryRun = False,
    limit: Limit = None,
) -> None:
    """Let a model rewrite instructions; run again to resume.

    With the paper's prompts, it describes how goals look and merges the parts of each instruction. With --no-images it
    only merges them. The key is read from OPENAI_API_KEY.
    """
    from evonav.decision.vlm.account import Account
    from evonav.decision.vlm.client import VlmClient, VlmConfig
    from evonav.decision.vlm.response_cache import ResponseCache
    from evonav.generation.instructions.writer import estimate_texts, write_texts

    model = endpoint.named_model()
    account = Account(spending.price(model), spending.max_cost)
    config = VlmConfig(model, base_url=endpoint.base_url, max_concurrency=concurrency)
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
