"""What commands show: tables, a moving line, a bar."""

from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from evonav.evaluation.engine import Progress
    from evonav.evaluation.metrics import AgentSummary


def print_table(summaries: "list[AgentSummary]") -> None:
    """Agents with their rates, and what is missing of a run."""
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
