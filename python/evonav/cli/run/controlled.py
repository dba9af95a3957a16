"""`evonav controlled`: generate, evaluate and report controlled analyses (docs/controlled.md)."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from evonav.cli.display import interruptible, print_table, show_tables, status
from evonav.cli.group import Command, new_app
from evonav.cli.options.decisions import refuse_costs_of_rules
from evonav.cli.options.settings import (
    BaseUrl,
    Decision,
    Isolation,
    MaxCost,
    Model,
    Perception,
    Prices,
    Set,
    settings_from,
)
from evonav.cli.options.shared import (
    EXIT_INCOMPLETE,
    HOUSES,
    Agents,
    AnyAsset,
    AssetFile,
    GeneratorFile,
    Limit,
    RetryErrored,
    Seed,
    StartOfHouses,
    Workers,
    house_options,
    names_of,
    num_workers_of,
)
from evonav.counted import counted

if TYPE_CHECKING:  # the command must start fast
    from evonav.evaluation.run.run import Progress

controlled_app = new_app("controlled", help="Measure what a change costs: the same tasks, one difference.")

Directory = Annotated[
    Path, typer.Argument(metavar="FOLDER", help="Folder of the analysis, from `evonav controlled generate`.")
]


@controlled_app.command(cls=Command)
def generate(
    out: Annotated[
        Path, typer.Option(metavar="FOLDER", help="Folder of the analysis; an unfinished analysis is resumed.")
    ],
    houses: Annotated[
        Path, typer.Option(metavar="HOUSES", help=f"Houses: {HOUSES}; or a folder of tasks, whose houses are used.")
    ],
    rates: Annotated[
        str | None,
        typer.Option(
            metavar="X,Y",
            help="Probabilities that the house changes between two stages, such as 0,0.5,1, each an arm. "
            "Default: generate Fixed / Not Fixed pairs.",
        ),
    ] = None,
    limit: Limit = None,
    per_house: Annotated[
        int, typer.Option(min=1, metavar="N", help="Number of tasks per house, with the seeds SEED, SEED+1, ...")
    ] = 1,
    seed: Seed = 0,
    config: GeneratorFile = None,
    allow_unknown_assets: AnyAsset = False,
    assets: AssetFile = None,
    start: StartOfHouses = "file",
    workers: Workers = None,
) -> None:
    """Generate the same tasks in arms that differ in one thing.

    Run again to resume.
    """
    from evonav.controlled.dataset import generate_controlled
    from evonav.controlled.layout import ControlledOptions
    from evonav.generation.config import read_parameters
    from evonav.parallel.worker import Workforce

    chosen: dict[str, Any] = {}
    if rates is not None:
        try:
            chosen = {"kind": "rates", "rates": tuple(float(rate) for rate in rates.split(","))}
        except ValueError:
            raise typer.BadParameter(f"--rates {rates}: numbers, comma-separated") from None
    options = ControlledOptions(
        seed=seed,
        per_house=per_house,
        parameters=read_parameters(config, evolve_probability=None, num_stages=None),
        allow_unknown_assets=allow_unknown_assets,
        **chosen,
    )
    with interruptible(out), status("Generating tasks") as show:
        record, num_new = generate_controlled(
            houses,
            out,
            options=options,
            limit=limit,
            completion=house_options(assets, start),
            workforce=Workforce(num_workers_of(workers)),
            on_progress=lambda done, total: show(f"{done} of {total}"),
        )
    arms = ", ".join(arm.name for arm in record.arms)
    typer.echo(f"{counted(len(record.task_ids), 'task')} in each arm ({arms}) in {out}; {num_new} new")
    for rejection in record.rejections:
        typer.echo(f"  without: {rejection.house}: {rejection.reason}")


@controlled_app.command(cls=Command)
def evaluate(
    directory: Directory,
    agent: Agents = None,
    seed: Seed = 0,
    retry_errored: RetryErrored = False,
    set_: Set = None,
    perception: Perception = "gt",
    workers: Workers = None,
    isolation: Isolation = None,
    decision: Decision = "text",
    model: Model = None,
    base_url: BaseUrl = None,
    prices: Prices = None,
    max_cost: MaxCost = None,
) -> None:
    """Evaluate agents in every arm; run again to resume.

    Results go to FOLDER/runs/ARM. Run again with other agents to add them.
    """
    from evonav.controlled.evaluate import evaluate_controlled
    from evonav.controlled.layout import read_controlled

    record = read_controlled(directory)
    given = {"simulator.allow_unknown_assets": record.options.allow_unknown_assets, "perception.make": perception}
    given |= {"workers": workers, "isolation": isolation, "decision.kind": decision, "decision.model": model}
    given |= {"decision.base_url": base_url, "prices": prices, "max_cost": max_cost}
    run = settings_from(given, set_)
    run = run.with_episodes([run.decision.kind], [run.simulator.kind])
    workforce = run.workforce()
    refuse_costs_of_rules(run)
    config = run.run_config(seed, directory)
    names = names_of(agent)

    def tell(arm: str, progress: "Progress") -> None:
        show(f"{arm} {progress.num_done} of {progress.num_stages} {progress.label}")

    with interruptible(directory), status("Running") as show:
        summaries = evaluate_controlled(
            directory,
            names,
            config=config,
            workforce=workforce,
            num_retries=run.num_retries,
            retry_errored=retry_errored,
            on_progress=tell,
        )
    for arm, of_arm in summaries.items():
        typer.echo(f"{arm}:")
        print_table(of_arm)
    if any(summary.is_incomplete for of_arm in summaries.values() for summary in of_arm):
        raise typer.Exit(EXIT_INCOMPLETE)


@controlled_app.command(cls=Command)
def report(
    directory: Directory,
    out: Annotated[Path | None, typer.Option(metavar="FOLDER", help="Folder to write. Default: FOLDER/report.")] = None,
) -> None:
    """Print the tables, and write a page with them, plots and all pairs."""
    from evonav.controlled.analysis import load_analysis
    from evonav.controlled.page import tables_of, write_controlled_report

    show_tables(tables_of(load_analysis(directory)))
    typer.echo(f"page: {write_controlled_report(directory, out)}")


@controlled_app.command(cls=Command)
def picture(
    directory: Directory,
    task: Annotated[
        str | None, typer.Option(metavar="ID", help="Task of the analysis. Default: the one with the largest effect.")
    ] = None,
    agent: Annotated[str, typer.Option(metavar="NAME", help="Agent to draw.")] = "fu",
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Picture to write: .svg, .png or .pdf (the last two need the extra `viz`). Default: FOLDER/pair.svg.",
        ),
    ] = None,
) -> None:
    """Draw one agent in one pair: Fixed left, Not Fixed right."""
    from evonav.controlled.analysis import load_analysis
    from evonav.controlled.paired_maps import highlighted_pairs, write_pair
    from evonav.errors import InvalidArgumentError

    analysis = load_analysis(directory)
    if agent not in analysis.agents:
        raise InvalidArgumentError(f"{directory}: no agent {agent!r}; there are {', '.join(analysis.agents)}")
    found = [key for key in analysis.keys(agent) if task is None or key[0] == task]
    if task is None:
        found = [key for _, key in highlighted_pairs(analysis, agent)] or found
    if not found:
        raise InvalidArgumentError(f"{directory}: no pair {task or ''} that {agent!r} has finished")
    typer.echo(f"picture: {write_pair(analysis, agent, found[0], out or directory / 'pair.svg')}")
