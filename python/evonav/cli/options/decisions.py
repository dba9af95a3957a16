"""Print what the model of a command costs."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evonav.cli.options.settings import MODEL_PANEL

if TYPE_CHECKING:  # the command must start fast
    from collections.abc import Sequence

    from evonav.evaluation.run.run import RunConfig
    from evonav.evaluation.run.run_settings import SpendingSettings
    from evonav.evaluation.run.settings import CommandSettings
    from evonav.tasks.listing import TaskFile

DryRun = Annotated[
    bool,
    typer.Option(
        "--dry-run",
        rich_help_panel=MODEL_PANEL,
        help="VLM: ask nothing; estimate requests, tokens and cost from a few tasks.",
    ),
]


def refuse_costs_of_rules(run: "CommandSettings", *, dry_run: bool = False) -> None:
    """Refuse options about the costs of a model where none is asked; other invalid settings of the model go first."""
    if run.decision.kind == "vlm":
        return
    run.decision.check()
    flags = {"prices": run.prices is not None, "max-cost": run.max_cost is not None, "dry-run": dry_run}
    for flag in (name for name, is_given in flags.items() if is_given):
        raise typer.BadParameter(f"--{flag} is for --decision vlm")


def print_estimate(
    spending: "SpendingSettings",
    agents: "Sequence[str]",
    tasks: "Sequence[TaskFile]",
    config: "RunConfig",
    num_workers: int,
) -> None:
    """Print what a run would ask and cost, estimated from a few of its tasks."""
    from evonav.cli.display import progress, show_tables
    from evonav.counted import counted
    from evonav.decision.backends import OUTPUT_TOKENS
    from evonav.evaluation.cost_estimate import estimate_run, total_usage
    from evonav.report.tables.table import Table

    options = dict(config.backend.decision.options)
    price = spending.price(options["model"])
    with progress() as show:
        estimates = estimate_run(agents, tasks, config, options, num_workers=num_workers, on_progress=show)
    first = estimates[0]
    title = f"Estimate for {counted(first.num_stages, 'stage')}, from {first.num_stages_run} run with the text matcher"
    rows = []
    for found in estimates:
        kinds = ", ".join(f"{kind} {count:.0f}" for kind, count in found.kinds.items())
        error = _relative(found.relative_error)
        cost = "?" if price is None else f"{price.of(total_usage([found])):.2f}"
        counts = (f"{found.num_requests:.0f}", kinds, f"{found.input_tokens:.0f}", error, f"{found.output_tokens:.0f}")
        rows.append((found.agent, *counts, cost))
    columns = ("agent", "requests", "by kind", "tokens in", "95%", "tokens out", "dollars")
    show_tables([Table(title, columns, tuple(rows))])
    typer.echo(
        "Input tokens assume 3 characters of text per token, and images as gpt-4o counts them: likely too many. "
        f"Output tokens assume {OUTPUT_TOKENS} per answer. The interval is over tasks (none if all or one were run). "
        "A model that decides differently may be asked more or less often."
    )
    if price is None:
        typer.echo("no dollars: name a file of prices with --prices")


def _relative(error: float) -> str:
    """Return the half width of an interval over tasks; there is none if every task was run, or only one."""
    return "-" if error in (0.0, float("inf")) else f"+-{100 * error:.0f}%"


def print_spending(out: Path) -> None:
    """Print what the models of a run were asked and cost, over all calls of the command."""
    from evonav.counted import counted
    from evonav.decision.vlm.account import LEDGER_NAME, Ledger

    path = out / LEDGER_NAME
    if not path.is_file():
        return
    for spent in Ledger(path).spending():
        lost = f" ({spent.num_without_answer} without an answer)" if spent.num_without_answer else ""
        cost = f", ${spent.cost_usd:.4f}" if spent.cost_usd else ""
        reserved = f", and ${spent.set_aside_usd:.4f} reserved" if spent.set_aside_usd > 1e-9 else ""
        typer.echo(
            f"{spent.model}: {counted(spent.num_asked, 'question')} asked{lost}, "
            f"{spent.num_replayed} answered from exchanges; "
            f"{spent.input_tokens} tokens in, {spent.output_tokens} out{cost}{reserved}"
        )
