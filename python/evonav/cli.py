"""The `evonav` command. Exit codes: 0 done, 1 an error that is told, 2 wrong usage, 3 incomplete, 130 interrupted."""

import os
import signal
import sys
from contextlib import ExitStack, contextmanager
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:  # the command must start fast: everything else is imported where it is used
    from collections.abc import Callable, Iterator, Mapping

    from evonav.evaluation.backend import Backend
    from evonav.evaluation.engine import Progress, RunConfig, TaskFile
    from evonav.evaluation.metrics import AgentSummary

EXIT_ERROR = 1
EXIT_INCOMPLETE = 3
EXIT_INTERRUPTED = 130
HEURISTICS = "fu,stage-reset,ftu"

app = typer.Typer(
    name="evonav",
    help="EvoNav-Bench: lifelong navigation in homes that change.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

Agents = Annotated[str, typer.Option(help="Names, comma-separated; see `evonav agents`.")]
HOUSES = "ProcTHOR JSON, JSONL, JSONL.gz, or procthor-10k:SPLIT"
Houses = Annotated[Path | None, typer.Option(help=f"{HOUSES} to generate tasks from.")]
Tasks = Annotated[Path | None, typer.Option(help="Folder of tasks; default: the bundled ones.")]
Limit = Annotated[int | None, typer.Option(min=1, help="Take the first N (multi-room) houses or tasks.")]
Seed = Annotated[int, typer.Option(min=0, help="Decides everything random.")]
Workers = Annotated[int | None, typer.Option(min=0, help="Processes; default: one a core. 0: in this process.")]
AnyAsset = Annotated[
    bool,
    typer.Option("--allow-unknown-assets", help="Objaverse houses: unknown assets get their category's usual size."),
]


class SimulatorName(str, Enum):
    """Which simulator runs the episodes."""

    EMBEDDED = "embedded"
    AI2THOR = "ai2thor"


class Platform(str, Enum):
    """How Unity draws."""

    CLOUD = "cloud"
    X11 = "x11"


Which = Annotated[SimulatorName, typer.Option(help="Evonav's own, or AI2-THOR through its client (docs/ai2thor.md).")]
ThorExecutable = Annotated[
    str | None, typer.Option(help="AI2-THOR: path of a build's executable, or `evonav`: our engine. Default: download.")
]
ThorCommit = Annotated[str | None, typer.Option(help="AI2-THOR: build to download. Default: the client's.")]
ThorPlatform = Annotated[Platform | None, typer.Option(help="AI2-THOR: Vulkan without a display, or an X display.")]
ThorGpu = Annotated[int | None, typer.Option(min=0, help="AI2-THOR: GPU to draw on.")]
ThorDisplay = Annotated[str | None, typer.Option(help="AI2-THOR: X display, such as :0. Default: DISPLAY.")]
ThorTimeout = Annotated[
    float,
    typer.Option(min=1.0, help="AI2-THOR: seconds for an answer, three times that to start; then it is restarted."),
]
Out = Annotated[Path, typer.Option(help="Folder of the run; an unfinished one is resumed.")]


@app.command()
def evaluate(
    out: Out,
    agents: Agents = HEURISTICS,
    houses: Houses = None,
    tasks: Tasks = None,
    limit: Limit = None,
    seed: Seed = 0,
    workers: Workers = None,
    retry_errored: Annotated[bool, typer.Option("--retry-errored", help="Run errored stages again.")] = False,
    allow_unknown_assets: AnyAsset = False,
    simulator: Which = SimulatorName.EMBEDDED,
    thor_executable: ThorExecutable = None,
    thor_commit: ThorCommit = None,
    thor_platform: ThorPlatform = None,
    thor_gpu: ThorGpu = None,
    thor_display: ThorDisplay = None,
    thor_timeout: ThorTimeout = 100.0,
) -> None:
    """Evaluates agents on tasks; run again to resume. Leaves records.sqlite and summary.json in OUT."""
    if houses is not None and tasks is not None:
        raise typer.BadParameter("give --houses or --tasks, not both")
    num_workers = _num_workers(workers)
    build = {
        "executable": thor_executable,
        "commit_id": thor_commit,
        "platform": None if thor_platform is None else thor_platform.value,
    }
    host = {"gpu_device": thor_gpu, "x_display": thor_display, "timeout_s": thor_timeout}
    config = _config(seed, _backend(simulator, allow_unknown_assets, build, host))
    with _tasks(out, houses, tasks, limit, seed, allow_unknown_assets) as task_files:
        summaries = _evaluate(out, agents, task_files, config, num_workers, retry_errored)
    _print_table(summaries)
    _exit(summaries)


@app.command()
def demo(
    out: Out = Path("out/demo"),
    agents: Agents = HEURISTICS,
    limit: Limit = None,
    seed: Seed = 0,
    workers: Workers = None,
) -> None:
    """Evaluates the paper's three heuristics on the bundled tasks and writes an HTML report."""
    num_workers = _num_workers(workers)
    with _tasks(out, None, None, limit, seed, False) as task_files:
        summaries = _evaluate(out, agents, task_files, _config(seed), num_workers, retry_errored=False)
    _print_table(summaries)
    _report(out)
    _exit(summaries)


@app.command()
def report(run: Annotated[Path, typer.Argument(help="Folder of a run.")]) -> None:
    """Writes a run's HTML report, from its records alone."""
    from evonav.evaluation.engine import write_summary

    _print_table(write_summary(run))
    _report(run)


@app.command()
def strip(
    run: Annotated[Path, typer.Argument(help="Folder of a run.")],
    out: Annotated[Path, typer.Option(help="SVG file to write.")],
    task: Annotated[str | None, typer.Argument(help="Id of a task of the run; default: the most telling one.")] = None,
    agents: Annotated[str, typer.Option(help="Agents of the run, comma-separated: a row each.")] = "ftu",
    stages: Annotated[str, typer.Option(help="Stages, comma-separated; default: all.")] = "",
) -> None:
    """Draws one task of a run as a picture: stages side by side, agents below each other."""
    from evonav.report import write_strip

    try:
        numbers = [int(stage) for stage in stages.split(",")] if stages else None
    except ValueError:
        raise typer.BadParameter(f"--stages {stages}: numbers, comma-separated") from None
    typer.echo(f"picture: {write_strip(run, task, agents.split(','), out, stages=numbers)}")


@app.command()
def generate(
    houses: Annotated[Path, typer.Option(help=f"{HOUSES}.")],
    out: Annotated[Path, typer.Option(help="Folder for the tasks.")],
    limit: Limit = None,
    seed: Seed = 0,
    allow_unknown_assets: AnyAsset = False,
) -> None:
    """Generates tasks from multi-room houses."""
    from evonav.evaluation.datasets import make_tasks

    with _status("Generating tasks") as tell:
        tasks = make_tasks(houses, out, limit=limit, seed=seed, allow_unknown_assets=allow_unknown_assets, on_task=tell)
    typer.echo(f"{len(tasks)} tasks in {out}")


class _ListByDefault(typer.core.TyperGroup):
    """`evonav houses FILE` is `evonav houses list FILE`."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:  # noqa: ANN401 (click's, or that of the copy in typer)
        if not args or (args[0] not in self.commands and args[0] != "--help"):
            args = ["list", *args]
        return super().parse_args(ctx, args)


houses_app = typer.Typer(cls=_ListByDefault, help="Lists houses (the default), or fetches published ones.")
app.add_typer(houses_app, name="houses")


@houses_app.command(name="list")
def list_houses(
    path: Annotated[Path | None, typer.Argument(help=f"{HOUSES}; default: bundled.")] = None,
    limit: Limit = None,
) -> None:
    """Lists houses with their rooms and objects."""
    from evonav.evaluation.datasets import house_facts

    for name, num_rooms, num_objects in house_facts(path, limit):
        typer.echo(f"{name}\t{num_rooms} rooms\t{num_objects} objects")


@houses_app.command(name="fetch")
def fetch_houses(
    dataset: Annotated[str, typer.Argument(help="procthor-10k")],
    revision: Annotated[str | None, typer.Option(help="Commit, tag or branch; default: that for AI2-THOR 5.")] = None,
    split: Annotated[list[str] | None, typer.Option(help="train, val or test, repeatable; default: all.")] = None,
    cache: Annotated[
        Path | None, typer.Option(help="Folder to keep it in; default: $EVONAV_CACHE or ~/.cache/evonav.")
    ] = None,
) -> None:
    """Downloads a published dataset of houses once; verifies its checksums from then on."""
    from evonav.house.procthor10k import NAME, REVISION, SPLITS
    from evonav.house.procthor10k_fetch import fetch_procthor10k

    if dataset != NAME:
        raise typer.BadParameter(f"{dataset}: expected {NAME}")
    unknown = [name for name in split or () if name not in SPLITS]
    if unknown:
        raise typer.BadParameter(f"--split {unknown[0]}: expected {', '.join(SPLITS)}")
    wanted = [name for name in SPLITS if not split or name in split]
    with _status(f"Fetching {NAME}") as tell:
        fetched = fetch_procthor10k(revision or REVISION, wanted, cache=cache, on_progress=tell)
    for name in wanted:
        entry = fetched.manifest.splits[name]
        state = "fetched" if name in fetched.new else "verified"
        typer.echo(f"{NAME}:{name}\t{entry.num_houses} houses\t{state}\t{fetched.folder / entry.file}")


@app.command(name="agents")
def list_agents() -> None:
    """Lists agents and yardsticks by name."""
    from evonav.agents.registry import agent_descriptions
    from evonav.evaluation.privileged import YARDSTICKS

    yardsticks = {name: f"yardstick: {kind.description}" for name, kind in YARDSTICKS.items()}
    for name, description in {**agent_descriptions(), **yardsticks}.items():
        typer.echo(f"{name:18}{description}")
    typer.echo(f"{'module:Class':18}any class of yours with the methods of evonav.agents.agent.Agent")


@app.command()
def version() -> None:
    """Prints the version."""
    from evonav import __version__

    typer.echo(__version__)


def main() -> None:
    """Runs the command; errors of evonav are one line, not a traceback."""
    from evonav.errors import EvonavError

    try:
        app()
    except EvonavError as error:
        typer.echo(f"error: {error}", err=True)
        sys.exit(EXIT_ERROR)


@contextmanager
def _tasks(
    out: Path, houses: Path | None, tasks: Path | None, limit: int | None, seed: int, allow_unknown_assets: bool
) -> "Iterator[list[TaskFile]]":
    """The tasks of a run: given, generated into the run's folder, or bundled."""
    from evonav.evaluation.datasets import bundled_tasks, make_tasks
    from evonav.evaluation.engine import task_file, task_files

    with ExitStack() as stack:
        if houses is not None:
            with _status("Generating tasks") as tell:
                generated = make_tasks(
                    houses,
                    out / "tasks",
                    limit=limit,
                    seed=seed,
                    allow_unknown_assets=allow_unknown_assets,
                    on_task=tell,
                )
            yield [task_file(root) for root in generated]
        else:
            directory = tasks if tasks is not None else stack.enter_context(bundled_tasks())
            yield task_files(directory, limit)


def _evaluate(
    out: Path,
    agents: str,
    task_files: "list[TaskFile]",
    config: "RunConfig",
    num_workers: int,
    retry_errored: bool,
) -> "list[AgentSummary]":
    from evonav.evaluation.engine import evaluate

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    signal.signal(signal.SIGTERM, interrupt)  # what a scheduler sends is to be as good as Ctrl-C
    try:
        with _status("Starting the simulator"):
            config.backend.check()
        with _progress() as show:
            return evaluate(
                [name.strip() for name in agents.split(",") if name.strip()],
                task_files,
                out,
                config=config,
                num_workers=num_workers,
                retry_errored=retry_errored,
                on_progress=show,
            )
    except KeyboardInterrupt:
        typer.echo(f"interrupted; finished stages are in {out}, the same command goes on from there", err=True)
        raise typer.Exit(EXIT_INTERRUPTED) from None


def _config(seed: int, backend: "Backend | None" = None) -> "RunConfig":
    from evonav.evaluation.backend import Backend
    from evonav.evaluation.engine import RunConfig

    return RunConfig(seed=seed, backend=backend or Backend())


def _backend(
    simulator: SimulatorName, allow_unknown_assets: bool, build: "Mapping[str, object]", host: "Mapping[str, object]"
) -> "Backend":
    """The simulator of the options; those that were not given are left to it."""
    from evonav.evaluation.backend import Backend

    module = "evonav.evaluation.backend"
    given = {key: value for key, value in build.items() if value is not None}
    if simulator is SimulatorName.AI2THOR:
        means = {key: value for key, value in host.items() if value is not None}
        return Backend(simulator=f"{module}:ai2thor_simulator", simulator_options=given, host_options=means)
    if given or any(host[key] is not None for key in ("gpu_device", "x_display")):
        raise typer.BadParameter("--thor-... options are for --simulator ai2thor")
    return Backend(simulator=f"{module}:lenient_simulator") if allow_unknown_assets else Backend()


def _exit(summaries: "list[AgentSummary]") -> None:
    if any(summary.is_incomplete for summary in summaries):
        raise typer.Exit(EXIT_INCOMPLETE)


def _report(run: Path) -> None:
    from evonav.report import write_report

    typer.echo(f"report: {write_report(run)}")


def _num_workers(workers: int | None) -> int:
    if workers is not None:
        return workers
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _print_table(summaries: "list[AgentSummary]") -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(title="SR and SPL in % with 95% intervals; SR by whether the target was moved")
    table.add_column("agent", no_wrap=True)
    for heading in ("n", "SR", "", "SPL", "", "moved", "not moved"):
        table.add_column(heading, justify="right")
    for summary in summaries:
        splits = (summary.splits.get(name) for name in ("relocated", "not_relocated"))
        table.add_row(
            summary.agent,
            str(summary.n),
            _percent(summary.sr),
            _percent_interval(summary.sr_ci95),
            _percent(summary.spl),
            _percent_interval(summary.spl_ci95),
            *("-" if rates is None else f"{_percent(rates.sr)} ({rates.n})" for rates in splits),
        )
    console = Console()
    console.print(table)
    for summary in summaries:
        if summary.is_incomplete:
            states = ", ".join(f"{count} {state}" for state, count in summary.counts.items() if count)
            console.print(f"incomplete: {summary.agent} has {summary.n} of {summary.num_stages} stages ({states})")


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{100 * value:.1f}"


def _percent_interval(interval: tuple[float, float] | None) -> str:
    return "" if interval is None else f"{100 * interval[0]:.0f}-{100 * interval[1]:.0f}"


@contextmanager
def _status(text: str) -> "Iterator[Callable[[str], None]]":
    """A line that moves while something takes its time."""
    from rich.console import Console

    console = Console(stderr=True)
    with console.status(text) as status:
        yield lambda name: status.update(f"{text}: {name}")


@contextmanager
def _progress() -> "Iterator[Callable[[Progress], None]]":
    """A bar over stages."""
    from rich import progress as bars
    from rich.console import Console

    columns = (
        bars.TextColumn("{task.description}"),
        bars.BarColumn(),
        bars.MofNCompleteColumn(),
        bars.TimeElapsedColumn(),
        bars.TimeRemainingColumn(),
    )
    with bars.Progress(*columns, console=Console(stderr=True)) as bar:
        stages = bar.add_task("stages")

        def show(news: "Progress") -> None:
            latest = news.latest
            described = "stages" if latest is None else f"{latest.agent} {latest.task_id}/{latest.stage}"
            bar.update(stages, completed=news.num_done, total=news.num_stages, description=described)

        yield show
