"""What commands show: tables, a moving line, a bar."""

import signal
import time
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import typer

EXIT_INTERRUPTED = 130
LINE_EVERY_S = 60.0
"""Lines of progress where there is no terminal."""

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from rich.table import Table

    from evonav.evaluation.metrics.navigation import AgentSummary
    from evonav.evaluation.run.run import Progress
    from evonav.generation.dataset import GenerationProgress


MAX_WIDTH = 200
"""Of tables where there is no terminal, in characters."""


def show(table: "Table") -> None:
    """Prints a table of which nothing is cut off, however narrow the terminal; without one, as wide as it likes."""
    from rich.console import Console
    from rich.measure import Measurement

    console = Console()
    needed = Measurement.get(console, console.options.update(max_width=MAX_WIDTH), table)
    width = needed.minimum if console.is_terminal else min(needed.maximum, MAX_WIDTH)
    Console(width=max(console.width, width)).print(table)


def print_table(summaries: "list[AgentSummary]") -> None:
    """Agents with their rates, and what is missing of a run."""
    from rich.table import Table

    table = Table(title="SR and SPL in % with 95% intervals; SR by whether the target was moved")
    table.add_column("agent", overflow="fold", min_width=12)  # may be a long path
    for heading in ("n", "SR", "", "SPL", "", "moved", "not moved"):
        table.add_column(heading, justify="right", no_wrap=True)
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
    show(table)
    for summary in summaries:
        if summary.is_incomplete:
            states = ", ".join(f"{count} {state}" for state, count in summary.counts.items() if count)
            typer.echo(f"incomplete: {summary.agent} has {summary.n} of {summary.num_stages} stages ({states})")


def print_failures(run: Path) -> None:
    """How often attempts at stages have failed, if any has, and where to read why."""
    from collections import Counter

    from evonav.evaluation.records.store import RunStore

    with RunStore(run) as store:
        failures = store.failures()
    for is_retried, what in ((True, "tried again"), (False, "errored")):
        kinds = Counter(failure.kind.value for failure in failures if failure.is_retried is is_retried)
        if kinds:
            typer.echo(f"stages {what}: {', '.join(f'{count} after {kind}' for kind, count in sorted(kinds.items()))}")
    if failures:
        typer.echo(f"why: evonav failures {run}")


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{100 * value:.1f}"


def _percent_interval(interval: tuple[float, float] | None) -> str:
    return "" if interval is None else f"{100 * interval[0]:.0f}-{100 * interval[1]:.0f}"


@contextmanager
def status(text: str) -> "Iterator[Callable[[str], None]]":
    """A line that moves while something takes its time."""
    from rich.console import Console

    console = Console(stderr=True)
    with console.status(text) as status:
        yield lambda name: status.update(f"{text}: {name}")


@contextmanager
def progress() -> "Iterator[Callable[[Progress], None]]":
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


@contextmanager
def generation_progress() -> "Iterator[Callable[[GenerationProgress], None]]":
    """A bar over houses on a terminal, else a line a minute."""
    from rich import progress as bars
    from rich.console import Console

    console = Console(stderr=True)
    if not console.is_terminal:
        told_s = time.monotonic()

        def tell(news: "GenerationProgress") -> None:
            nonlocal told_s
            if time.monotonic() - told_s >= LINE_EVERY_S:
                told_s = time.monotonic()
                left_s = news.seconds * (1.0 - news.share) / news.share if news.share else float("inf")
                typer.echo(f"{100 * news.share:.0f}%: {_counts(news)}, about {left_s / 60:.0f} min left", err=True)

        yield tell
        return
    columns = (
        bars.TextColumn("{task.description}"),
        bars.BarColumn(),
        bars.TaskProgressColumn(),
        bars.TimeElapsedColumn(),
        bars.TimeRemainingColumn(),
    )
    with bars.Progress(*columns, console=console) as bar:
        houses = bar.add_task("starting", total=1.0)
        yield lambda news: bar.update(houses, completed=news.share, description=_counts(news))


def _counts(news: "GenerationProgress") -> str:
    failed = f", {news.num_failed} failed" if news.num_failed else ""
    return f"{news.num_tasks} tasks ({news.tasks_per_s:.1f}/s), {news.num_rejected} houses rejected{failed}"


@contextmanager
def interruptible(out: Path) -> "Iterator[None]":
    """Says of an interrupt what it leaves; what a scheduler sends is to be as good as Ctrl-C."""

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    except KeyboardInterrupt:
        typer.echo(f"interrupted; what is finished is in {out}, the same command goes on from there", err=True)
        raise typer.Exit(EXIT_INTERRUPTED) from None
