"""`evonav evaluate`: run agents on tasks."""

from contextlib import contextmanager, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evonav.cli.display import generation_progress, interruptible, print_table, progress, show_tables, status
from evonav.cli.options.decisions import DryRun, print_estimate, print_spending, refuse_costs_of_rules
from evonav.cli.options.settings import (
    BaseUrl,
    Decision,
    Isolation,
    MaxCost,
    Model,
    Perception,
    Prices,
    Set,
    Simulator,
    settings_from,
)
from evonav.cli.options.shared import (
    EXIT_INCOMPLETE,
    Agents,
    AnyAsset,
    AssetFile,
    Houses,
    Limit,
    Out,
    RetryErrored,
    Seed,
    StartOfHouses,
    Subset,
    Tasks,
    Workers,
    chosen_tasks,
    names_of,
    read_houses,
)
from evonav.cli.run.failures import print_failures

if TYPE_CHECKING:  # the command must start fast: everything else is imported where it is used
    from collections.abc import Callable, Iterator
    from contextlib import AbstractContextManager

    from evonav.evaluation.metrics.navigation import AgentSummary
    from evonav.evaluation.run.run import Progress, RunConfig
    from evonav.evaluation.run.settings import CommandSettings
    from evonav.house.files import HouseTexts
    from evonav.tasks.listing import TaskFile

DEVELOP_PANEL = "For agents under development"


def evaluate(
    context: typer.Context,
    out: Out,
    agent: Agents = None,
    houses: Houses = None,
    assets: AssetFile = None,
    start: StartOfHouses = "file",
    allow_unknown_assets: AnyAsset = False,
    tasks: Tasks = None,
    limit: Limit = None,
    subset: Subset = None,
    seed: Seed = 0,
    retry_errored: RetryErrored = False,
    set_: Set = None,
    simulator: Simulator = "embedded",
    perception: Perception = "gt",
    workers: Workers = None,
    isolation: Isolation = None,
    decision: Decision = "text",
    model: Model = None,
    base_url: BaseUrl = None,
    prices: Prices = None,
    max_cost: MaxCost = None,
    dry_run: DryRun = False,
    fail_fast: Annotated[
        bool,
        typer.Option(
            "--fail-fast", rich_help_panel=DEVELOP_PANEL, help="Stop at the first errored stage with its traceback."
        ),
    ] = False,
    pdb: Annotated[
        bool,
        typer.Option(
            "--pdb", rich_help_panel=DEVELOP_PANEL, help="Open the debugger where an agent raises, then stop."
        ),
    ] = False,
    profile: Annotated[
        bool,
        typer.Option(
            "--profile",
            rich_help_panel=DEVELOP_PANEL,
            help="Print where CPU time goes; write a flame graph to OUT/profile.",
        ),
    ] = False,
) -> None:
    """Evaluate agents on tasks; run again to resume.

    Three agents run on the bundled tasks by default. Look at the results with `evonav report OUT`.
    """
    context.with_resource(early_worker())  # before imports, which take as long as its start
    from evonav.evaluation.run.evaluate import evaluate_all
    from evonav.evaluation.run.run import Evaluation

    if houses is not None and tasks is not None:
        raise typer.BadParameter("give --houses or --tasks, not both")
    if houses is None and (assets is not None or start != "file"):
        raise typer.BadParameter("--assets and --start belong to --houses: tasks hold houses as they were generated")
    given = {"simulator.kind": simulator, "simulator.allow_unknown_assets": allow_unknown_assets}
    given |= {"perception.make": perception, "workers": workers, "isolation": isolation, "decision.kind": decision}
    given |= {"decision.model": model, "decision.base_url": base_url, "prices": prices, "max_cost": max_cost}
    run = settings_from(given, set_)
    if profile:
        from evonav.report.profile import profiling, write_profile

        run = profiled(run)
    if pdb:
        from evonav.evaluation.hosting.agent import check_terminal
        from evonav.evaluation.hosting.isolation import AgentHosting

        check_terminal()
        run = run.model_copy(update={"workers": 0, "isolation": "none"})
    run = run.with_episodes([run.decision.kind], [run.simulator.kind])
    workforce = run.workforce()
    refuse_costs_of_rules(run, dry_run=dry_run)
    config = run.run_config(seed, out, asks_model=not dry_run)
    if pdb:
        config = replace(config, hosting=AgentHosting("debugger"))
    names = names_of(agent)
    if houses is None:
        task_files = chosen_tasks(tasks, limit, subset)
    else:
        task_files = _generated(out, read_houses(houses, assets, start), limit, subset, seed, run)
    if dry_run:
        print_estimate(run, names, task_files, config, run.num_workers)
        return
    sampling = profiling(out) if profile else nullcontext()
    with running(out, config, has_bar=not pdb) as show, stopping_early(out), sampling:
        (summaries,) = evaluate_all(
            [Evaluation(tuple(names), tuple(task_files), out, config)],
            workforce,
            num_retries=run.num_retries,
            retry_errored=retry_errored or fail_fast or pdb,
            on_progress=lambda _, state: show(stopped_early(state, pdb) if fail_fast or pdb else state),
        )
    print_results(out, summaries)
    if profile:
        tables, flame_graph = write_profile(out)
        show_tables(tables)
        typer.echo(f"flame graph, for https://www.speedscope.app: {flame_graph}")
    exit_if_incomplete(summaries)


def early_worker() -> "AbstractContextManager[None]":
    """Start a worker while the command still imports what decides its settings."""
    from evonav.evaluation.run import PROGRAM
    from evonav.parallel.local import started_early

    return started_early(PROGRAM)


def _generated(
    out: Path, houses: "HouseTexts", limit: int | None, subset: str | None, seed: int, run: "CommandSettings"
) -> "list[TaskFile]":
    """Generate the tasks of a run from houses into the run's folder."""
    from evonav.generation.dataset import generate_dataset, inherited_names
    from evonav.generation.worker import GenerationOptions
    from evonav.parallel.worker import Workforce
    from evonav.tasks.listing import task_file

    dataset, split = inherited_names(houses)
    allows_any = run.simulator.allow_unknown_assets
    options = GenerationOptions(seed=seed, dataset=dataset, split=split, allow_unknown_assets=allows_any)
    with interruptible(out / "tasks"), generation_progress() as show:
        generated = generate_dataset(
            houses,
            out / "tasks",
            options=options,
            limit=limit,
            subset=subset,
            workforce=Workforce(run.num_workers),
            on_progress=show,
        )
    return [task_file(root) for root in generated.roots]


@contextmanager
def running(out: Path, config: "RunConfig", *, has_bar: bool = True) -> "Iterator[Callable[[Progress], None]]":
    """Show the progress of a run, which the yielded function updates; an interrupt says how to resume.

    Args:
        has_bar: Show a bar; a debugger needs the terminal for itself.
    """
    with interruptible(out):
        with status("Starting the simulator"):
            config.backend.check()
        if not has_bar:
            yield lambda _: None
            return
        with progress() as show:
            yield show


class _StageErroredError(Exception):
    """A stage errored in a run that stops at the first such stage."""


def stopped_early(state: "Progress", is_brief: bool) -> "Progress":
    """Return the progress; `_StageErroredError` if it has errored, with the traceback unless it is brief."""
    latest = state.latest
    if latest is not None and latest.failure is not None:
        failure = latest.failure
        traceback = "" if is_brief else failure.traceback
        raise _StageErroredError(f"{traceback}{latest.label}: {failure.kind.phrase}: {failure.message}")
    return state


@contextmanager
def stopping_early(out: Path) -> "Iterator[None]":
    """Print why a run stopped at its first errored stage, and end the command."""
    try:
        yield
    except _StageErroredError as error:
        typer.echo(str(error), err=True)
        typer.echo(f"stopped at the first errored stage; the stages before it are in {out}", err=True)
        raise typer.Exit(EXIT_INCOMPLETE) from None


def print_results(out: Path, summaries: "list[AgentSummary]") -> None:
    """Print success rates, failures and the costs of models."""
    print_table(summaries)
    print_failures(out)
    print_spending(out)


def profiled(run: "CommandSettings") -> "CommandSettings":
    """Return settings with which all processes of a run can be sampled; `BadParameter` if they cannot."""
    from evonav.parallel.profiling import IS_SUPPORTED

    if not IS_SUPPORTED:
        raise typer.BadParameter("--profile needs a system with interval timers, such as Linux or macOS")
    if run.engine == "ray":
        raise typer.BadParameter("--profile samples workers on this machine only: not with engine=ray")
    if run.isolation == "sandbox":
        raise typer.BadParameter("--profile needs agents that can write their samples: use --isolation process")
    if (run.episodes_at_once or 1) > 1:
        raise typer.BadParameter("--profile samples one thread of each worker: use --set episodes_at_once=1")
    return run.model_copy(update={"isolation": run.isolation or "process", "episodes_at_once": 1})


def exit_if_incomplete(summaries: "list[AgentSummary]") -> None:
    """End the command with `EXIT_INCOMPLETE` if a stage errored or was not run."""
    if any(summary.is_incomplete for summary in summaries):
        raise typer.Exit(EXIT_INCOMPLETE)
