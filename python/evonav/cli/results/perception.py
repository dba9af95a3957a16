"""`evonav perception`: measure perceptions against the truth."""

from pathlib import Path
from typing import Annotated

import typer

from evonav.cli.display import interruptible, progress_bar, show_tables
from evonav.cli.options.settings import set_option, settings_from
from evonav.cli.options.shared import (
    EXIT_INCOMPLETE,
    AnyAsset,
    Limit,
    Seed,
    Subset,
    Tasks,
    Workers,
    chosen_tasks,
    num_workers_of,
)
from evonav.counted import counted

KEYS = ("perception.models", "perception.device")
"""The keys that `--set` takes."""


def perception(
    tasks: Tasks = None,
    perceptions: Annotated[
        list[str] | None,
        typer.Option(
            "--perception",
            metavar="NAME",
            help="Perception to measure: gt, noisy:PRESET, predicted:STACK or module:function (see `evonav evaluate`). "
            "Repeat the option for more. Default: gt.",
        ),
    ] = None,
    out: Annotated[
        Path,
        typer.Option(metavar="FOLDER", help="Folder of the records and the report; finished tasks are not run again."),
    ] = Path("out/perception"),
    limit: Limit = None,
    subset: Subset = None,
    views_per_room: Annotated[
        int,
        typer.Option(
            min=1, metavar="N", help="Largest number of views of a room: 6 from each of several places far apart."
        ),
    ] = 12,
    houses_per_task: Annotated[
        int,
        typer.Option(
            min=1,
            metavar="N",
            help="Number of states of a task's house to visit, in the order of its stages. With 1 nothing moves, so no "
            "memory becomes stale.",
        ),
    ] = 2,
    seed: Seed = 0,
    allow_unknown_assets: AnyAsset = False,
    workers: Workers = None,
    set_: Annotated[list[str] | None, set_option(*KEYS)] = None,
) -> None:
    """Measure what perceptions find and remember, against the truth.

    Every perception sees the same views. Run again to resume. Writes report.html, summary.json, .csv and .md.
    """
    from evonav.evaluation.run.settings import PerceptionSettings, SimulatorSettings
    from evonav.perception_benchmark.benchmark import PerceptionSpec, TourConfig, measure
    from evonav.perception_benchmark.page import write_perception_report
    from evonav.perception_benchmark.tables import perception_tables

    names = perceptions or ["gt"]
    models = settings_from({}, set_, KEYS).perception
    if models.model_fields_set and not any(word.startswith("predicted") for word in names):
        raise typer.BadParameter(
            f"--set perception.{next(iter(models.model_fields_set))} is for --perception predicted"
        )
    specs = []
    for word in names:
        settings = models if word.startswith("predicted") else PerceptionSettings()
        specs.append(PerceptionSpec(word, settings.model_copy(update={"make": word}).component()))
    simulation = SimulatorSettings(allow_unknown_assets=allow_unknown_assets)
    task_files = chosen_tasks(tasks, limit, subset)
    with interruptible(out):
        with progress_bar("tours") as on_progress:
            done, failures = measure(
                specs,
                task_files,
                out,
                config=TourConfig(views_per_room, houses_per_task, seed),
                simulator=simulation.component(),
                num_workers=num_workers_of(workers),
                on_progress=on_progress,
            )
        for word, task_id, why in failures:
            typer.echo(f"failed: {word} {task_id}: {why}", err=True)
        if done:
            page, shown = write_perception_report(out)
            show_tables(perception_tables(shown, is_brief=True))
            typer.echo(f"page: {page}; tables: {out / 'summary.md'}, .csv, .json")
    if failures:
        typer.echo(f"incomplete: {counted(len(done), 'task')} done; run the same command again to resume", err=True)
        raise typer.Exit(EXIT_INCOMPLETE)
