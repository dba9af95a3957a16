"""`evonav bench`: how fast evonav is on this machine, beside other libraries."""

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from evonav.cli.bench.memory import memory_app, tell_worse
from evonav.cli.display import EXIT_INTERRUPTED, progress_bar, show_tables
from evonav.cli.group import Command, new_app
from evonav.cli.options.shared import HOUSES, Against, Agents, Limit, listed, numbers_of

if TYPE_CHECKING:  # the command must start fast
    from evonav.speed_benchmark.records import Row
    from evonav.speed_benchmark.run import Section

bench_app = new_app(help="Measure scene memories, and evonav's speed on this machine.")
bench_app.add_typer(memory_app, name="memory")

Repeats = Annotated[int, typer.Option(min=1, metavar="N", help="Number of times that everything is measured.")]
Peers = Annotated[
    list[str] | None,
    typer.Option(
        "--peer",
        metavar="NAME",
        help="Peer to run beside evonav, or none. Repeat the option for more, or separate them by commas. Default: all "
        "that are installed; the extra `bench` installs them.",
    ),
]
BenchOut = Annotated[Path | None, typer.Option("--out", metavar="FOLDER", help="Folder to write JSON and Markdown to.")]


def _run(
    section: "Section",
    limit: int | None,
    repeats: int,
    peer: "Sequence[str] | None",
    out: Path | None,
    before: Path | None,
    *,
    is_one_core: bool = True,
    **options: Any,  # noqa: ANN401 - the section's own
) -> None:
    """Measure a section, print its table, write its files and compare it."""
    from evonav.speed_benchmark.records import read_speeds, write_speeds
    from evonav.speed_benchmark.run import against, markdown_of, run_section, speed_table, table_of
    from evonav.speed_benchmark.timing import Sampling, one_core

    earlier = None if before is None else read_speeds(before)
    names = listed(peer)
    peers = None if not names else [name for name in names if name != "none"]
    rows: list[Row] = []
    try:
        with ExitStack() as stack:
            if is_one_core:
                stack.enter_context(one_core())
            on_progress = stack.enter_context(progress_bar(section.TITLE))
            sampling = Sampling(limit, repeats, peers, on_progress)
            speeds = run_section(section, sampling, on_row=rows.append, **options)
    except KeyboardInterrupt:
        if rows:
            show_tables([speed_table(f"{section.TITLE}, interrupted", rows)])
        typer.echo("interrupted; nothing is written", err=True)
        raise typer.Exit(EXIT_INTERRUPTED) from None
    show_tables([table_of(speeds)])
    if out is not None:
        typer.echo(f"written: {', '.join(map(str, write_speeds(speeds, out, markdown_of(speeds))))}")
    if earlier is not None and before is not None:
        tell_worse(before, against(earlier, speeds), earlier.machine if earlier.machine != speeds.machine else None)


@bench_app.command(cls=Command)
def render(
    limit: Limit = None, repeats: Repeats = 1, peer: Peers = None, out: BenchOut = None, against: Against = None
) -> None:
    """Measure the time of an image.

    Peers: embreex, moderngl.
    """
    from evonav.speed_benchmark import rendering

    _run(rendering, limit, repeats, peer, out, against)


@bench_app.command(cls=Command)
def navigation(
    limit: Limit = None, repeats: Repeats = 1, peer: Peers = None, out: BenchOut = None, against: Against = None
) -> None:
    """Measure the time of a shortest path.

    Peers: pyastar2d, scikit-image, scipy.
    """
    from evonav.speed_benchmark import navigation as section

    _run(section, limit, repeats, peer, out, against)


@bench_app.command(cls=Command)
def mapping(
    limit: Limit = None, repeats: Repeats = 1, peer: Peers = None, out: BenchOut = None, against: Against = None
) -> None:
    """Measure the time of a map's update.

    Peers: octomap, open3d.
    """
    from evonav.speed_benchmark import mapping as section

    _run(section, limit, repeats, peer, out, against)


@bench_app.command(cls=Command)
def gym(
    num_envs: Annotated[
        list[str] | None,
        typer.Option(
            "--envs",
            metavar="N",
            help="Number of environments. Repeat the option for more, or separate them by commas. Default: 1,8,64.",
        ),
    ] = None,
    num_steps: Annotated[int, typer.Option("--steps", min=1, metavar="N", help="Steps of each of three rounds.")] = 64,
    limit: Limit = None,
    repeats: Repeats = 1,
    peer: Peers = None,
    out: BenchOut = None,
    against: Against = None,
) -> None:
    """Measure the time of an environment's step.

    Peers: sync and async, which are Gymnasium's own; embreex, moderngl.
    """
    from evonav.speed_benchmark import gym as section

    sizes = numbers_of("--envs", num_envs) or section.NUM_ENVS
    if min(sizes) < 1:
        raise typer.BadParameter(f"--envs {min(sizes)}: must be at least 1")
    _run(section, limit, repeats, peer, out, against, is_one_core=False, num_envs=sizes, num_steps=num_steps)


@bench_app.command(cls=Command)
def agents(
    agent: Agents = None,
    growth: Annotated[
        bool, typer.Option(help="Measure also how much memory a long task takes, in a process of its own.")
    ] = True,
    repeats: Repeats = 1,
    out: BenchOut = None,
    against: Against = None,
) -> None:
    """Measure the time of an agent's decision round, and its memory."""
    from evonav.speed_benchmark import agents as section

    _run(section, None, repeats, ["none"], out, against, agents=listed(agent) or None, has_growth=growth)


@bench_app.command(cls=Command)
def generation(
    houses: Annotated[str, typer.Option(metavar="HOUSES", help=f"Houses to generate tasks from: {HOUSES}.")] = (
        "bundled"
    ),
    limit: Limit = None,
    repeats: Repeats = 1,
    out: BenchOut = None,
    against: Against = None,
) -> None:
    """Measure the time of generating a task, with all of its files written."""
    from evonav.speed_benchmark import generation as section

    title = "bundled, 1-10 rooms" if houses == "bundled" else Path(houses).name
    _run(section, limit, repeats, ["none"], out, against, houses=houses, title=title)
