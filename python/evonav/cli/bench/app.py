"""`evonav bench`: how fast evonav is on this machine, compared with other libraries."""

from contextlib import nullcontext
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from evonav.cli.bench.memory import memory_app, tell_worse
from evonav.cli.display import EXIT_INTERRUPTED, progress_bar, show_tables
from evonav.cli.group import Command, new_app
from evonav.cli.options.shared import HOUSES, Against, Limit, did_you_mean, listed, numbers_of

if TYPE_CHECKING:  # the command must start fast
    from evonav.speed_benchmark.run import Section
    from evonav.speed_benchmark.timing import Row

bench_app = new_app(help="Measure scene memories, and evonav's speed on this machine.")
bench_app.add_typer(memory_app, name="memory")

SECTIONS = {
    "render": "rendering",
    "navigation": "navigation",
    "mapping": "mapping",
    "gym": "gym",
    "agents": "agents",
    "generation": "generation",
}
"""Sections of `evonav bench speed`, each with its module of `evonav.speed_benchmark`."""


@bench_app.command(cls=Command)
def speed(
    section: Annotated[str, typer.Argument(metavar="SECTION", help=f"What to measure: {', '.join(SECTIONS)}.")],
    limit: Limit = None,
    repeats: Annotated[int, typer.Option(min=1, metavar="N", help="Number of times that everything is measured.")] = 1,
    peer: Annotated[
        list[str] | None,
        typer.Option(
            "--peer",
            metavar="NAME",
            help="Peer to compare evonav with, or none. Repeat the option for more, or separate them by commas. "
            "Default: all that are installed; the extra `bench` installs them.",
        ),
    ] = None,
    houses: Annotated[
        str | None, typer.Option(metavar="HOUSES", help=f"generation: houses: {HOUSES}. Default: bundled.")
    ] = None,
    agent: Annotated[
        list[str] | None, typer.Option("--agent", metavar="NAME", help="agents: some of them. Default: all.")
    ] = None,
    growth: Annotated[
        bool | None,
        typer.Option("--growth/--no-growth", help="agents: measure the memory of a long task. Default: growth."),
    ] = None,
    envs: Annotated[
        list[str] | None,
        typer.Option(metavar="N", help="gym: numbers of environments. Default: 1,2,4,8,16,32,64."),
    ] = None,
    steps: Annotated[
        int | None, typer.Option(min=1, metavar="N", help="gym: steps of each of three rounds. Default: 64.")
    ] = None,
    out: Annotated[Path | None, typer.Option(metavar="FOLDER", help="Folder to write JSON and Markdown to.")] = None,
    against: Against = None,
) -> None:
    """Measure evonav's speed on this machine, compared with other libraries.

    render: an image (peers: embreex, moderngl). navigation: a shortest path (pyastar2d, scikit-image, scipy). mapping:
    a map's update (octomap, open3d). gym: an environment's step (sync and async, which are Gymnasium's own; embreex,
    moderngl). agents: an agent's decision round, and its memory. generation: a task, with all of its files written.
    """
    from evonav.speed_benchmark.run import against as compare
    from evonav.speed_benchmark.run import markdown_of, read_speeds, run_section, speed_table, table_of, write_speeds
    from evonav.speed_benchmark.timing import Sampling, one_core

    if section not in SECTIONS:
        raise typer.BadParameter(f"{section}: expected {', '.join(SECTIONS)}{did_you_mean(section, SECTIONS)}")
    own = {"--houses": (houses, "generation"), "--agent": (agent, "agents"), "--no-growth": (growth, "agents")}
    for option, (value, of) in {**own, "--envs": (envs, "gym"), "--steps": (steps, "gym")}.items():
        if value is not None and section != of:
            raise typer.BadParameter(f"{option} is for `evonav bench speed {of}`")
    options: dict[str, Any] = {}
    if section == "generation":
        options = {"houses": houses or "bundled", "title": Path(houses).name if houses else "bundled, 1-10 rooms"}
    elif section == "agents":
        options = {"agents": listed(agent) or None, "has_growth": growth is not False}
    elif section == "gym":
        sizes = numbers_of("--envs", envs)
        if sizes and min(sizes) < 1:
            raise typer.BadParameter(f"--envs {min(sizes)}: must be at least 1")
        options = {**({"num_envs": sizes} if sizes else {}), **({} if steps is None else {"num_steps": steps})}
    module = cast("Section", import_module(f"evonav.speed_benchmark.{SECTIONS[section]}"))
    earlier = None if against is None else read_speeds(against)
    names = ["none"] if section in ("agents", "generation") else listed(peer)
    peers = [name for name in names if name != "none"] if names else None
    rows: list[Row] = []
    try:
        with nullcontext() if section == "gym" else one_core(), progress_bar(module.TITLE) as on_progress:
            sampling = Sampling(limit, repeats, peers, on_progress)
            speeds = run_section(module, sampling, on_row=rows.append, **options)
    except KeyboardInterrupt:
        if rows:
            show_tables([speed_table(f"{module.TITLE}, interrupted", rows)])
        typer.echo("interrupted; nothing is written", err=True)
        raise typer.Exit(EXIT_INTERRUPTED) from None
    show_tables([table_of(speeds)])
    if out is not None:
        typer.echo(f"written: {', '.join(map(str, write_speeds(speeds, out, markdown_of(speeds))))}")
    if earlier is not None and against is not None:
        other_machine = earlier.machine if earlier.machine != speeds.machine else None
        tell_worse(against, compare(earlier, speeds), other_machine)
