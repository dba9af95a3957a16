"""Show tables, status lines and progress bars."""

import signal
import time
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from evonav.counted import counted

EXIT_INTERRUPTED = 130
LINE_EVERY_S = 60.0
"""Seconds between two lines of progress where there is no terminal."""

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from rich.table import Table as RichTable

    from evonav.evaluation.metrics.navigation import AgentSummary
    from evonav.evaluation.run.run import Progress
    from evonav.generation.dataset import GenerationProgress
    from evonav.house.generated import MakingProgress
    from evonav.report.plots.specs import Plot
    from evonav.report.tables.table import Table


_GAP = 3
"""Width of the space between two columns of a table, in characters."""


def show(table: "RichTable") -> None:
    """Print a table of a terminal's own; cells that are not wrapped are never cut off."""
    from rich.console import Console
    from rich.measure import Measurement

    console = Console()
    needed = Measurement.get(console, console.options, table).minimum
    Console(width=max(console.width, needed)).print(table)


def show_tables(tables: "Iterable[Table]", *, notes: "Sequence[str]" = ()) -> None:
    """Print tables of a report, then notes, those of all tables once.

    A table that is wider than the terminal is printed with rows as columns if that fits, else in parts, below each
    other. Agents of files and modules are shown by their classes.
    """
    from textwrap import fill

    from rich.console import Console
    from rich.measure import Measurement
    from rich.text import Text

    from evonav.report.tables.table import short_names

    console = Console()
    found = list(tables)
    names = short_names(text for table in found for row in (table.columns, *table.rows) for text in row)
    for table in found:
        for part in in_parts(table.renamed(names), console.width):
            shown = part.rich()
            if Measurement.get(console, console.options.update(width=10_000), shown).maximum > console.width:
                for column, heading, texts in zip(shown.columns, part.columns, _texts(part), strict=True):
                    column.header = Text(fill(heading, max(1, *map(len, texts))))  # headings are wrapped, and no cell
            console.print(shown)
    own = [f"{short} is {name}." for name, short in names.items()]
    every_note = [*own, *(note for table in found for note in table.renamed(names).notes), *notes]
    if every_note:
        console.print("\n".join(dict.fromkeys(every_note)), style="dim italic", markup=False, highlight=False)


def in_parts(table: "Table", width: int) -> "list[Table]":
    """Return a table, without its notes, so that no line is longer than `width`: as it is, turned, or in parts.

    A table is turned, rows as columns, if that fits. Else its columns are split. Every part repeats the columns that
    name a row: the first ones, as many as tell all rows apart. A cell that is wider than the space that is left is
    wrapped.
    """
    from dataclasses import replace

    table = replace(table, notes=())
    prefixes = range(1, len(table.columns))
    num_keys = next((k for k in prefixes if len({row[:k] for row in table.rows}) == len(table.rows)), 1)
    if _width_of(table, range(len(table.columns))) <= width:
        return [table]
    turned = _turned(table, num_keys)
    if len(table.rows) <= len(table.columns) and _width_of(turned, range(len(turned.columns))) <= width:
        return [turned]
    taken = min(_width_of(table, range(num_keys)) + 1, 1 + width // 2)
    groups: list[list[int]] = [[]]
    for column in range(num_keys, len(table.columns)):
        if groups[-1] and taken + _width_of(table, [*groups[-1], column]) > width:
            groups.append([])
        groups[-1].append(column)
    parts = []
    for number, group in enumerate(groups):
        columns = [*range(num_keys), *group]
        parts.append(
            replace(
                table,
                title=table.title if number == 0 else f"{table.title}, continued",
                columns=tuple(table.columns[column] for column in columns),
                rows=tuple(tuple(row[column] for column in columns) for row in table.rows),
                best=frozenset((row, columns.index(column)) for row, column in table.best if column in columns),
            )
        )
    return parts


def _width_of(table: "Table", columns: "Iterable[int]") -> int:
    """Return the width of columns of a table, in characters; only headings are wrapped."""
    texts = _texts(table)
    return sum(_GAP + max(map(len, texts[column])) for column in columns)


def _texts(table: "Table") -> list[list[str]]:
    """Return what stays on a line in each column: the words of its heading, and its cells."""
    return [
        ["", *heading.split(), *(row[column] for row in table.rows)] for column, heading in enumerate(table.columns)
    ]


def _turned(table: "Table", num_keys: int) -> "Table":
    """Return a table with its rows as columns, under the texts of their first `num_keys` columns."""
    from dataclasses import replace

    return replace(
        table,
        columns=("", *(" ".join(filter(None, row[:num_keys])) for row in table.rows)),
        rows=tuple(
            (table.columns[column], *(row[column] for row in table.rows))
            for column in range(num_keys, len(table.columns))
        ),
        best=frozenset((column - num_keys, row + 1) for row, column in table.best if column >= num_keys),
    )


def write_files(
    files: "Sequence[Path] | None",
    texts: "Mapping[str, Callable[[Path], str]]",
    plots: "Callable[[], Sequence[Plot]] | None" = None,
    *,
    is_error: bool = False,
) -> None:
    """Write files in the formats that their names end with, and print their paths.

    Args:
        texts: Content by the end of the name; a function takes the path.
        plots: Kind of all other files.
        is_error: Print to standard error.
    """
    from evonav.parallel.folders import write_atomically
    from evonav.report.plots.render import write_plots

    for path in files or ():
        if path.suffix in texts:
            written = write_atomically(path, texts[path.suffix](path))
        else:
            assert plots is not None, "the option takes no other name"
            written = write_plots(plots(), path)
        typer.echo(f"written: {written}", err=is_error)


def print_table(summaries: "list[AgentSummary]") -> None:
    """Print the rates of agents, and how many stages are missing."""
    from rich.table import Table
    from rich.text import Text

    from evonav.report.tables.table import short_names

    names = short_names(summary.agent for summary in summaries)
    table = Table(title="SR and SPL in % with 95% intervals; SR by whether the target moved")
    table.add_column("agent", overflow="fold")
    for heading in ("n", "SR", "95%", "SPL", "95%", "moved", "not moved"):
        table.add_column(heading, justify="right", no_wrap=True)
    for summary in summaries:
        splits = (summary.splits.get(name) for name in ("relocated", "not_relocated"))
        table.add_row(
            Text(names.get(summary.agent, summary.agent)),
            str(summary.n),
            percent(summary.sr),
            _percent_interval(summary.sr_ci95),
            percent(summary.spl),
            _percent_interval(summary.spl_ci95),
            *("-" if rates is None else f"{percent(rates.sr)} ({rates.n})" for rates in splits),
        )
    show(table)
    for name, short in names.items():
        typer.echo(f"{short} is {name}.")
    for summary in summaries:
        if summary.is_incomplete:
            states = ", ".join(f"{count} {state}" for state, count in summary.counts.items() if count)
            typer.echo(f"incomplete: {summary.agent} has {summary.n} of {summary.num_stages} stages ({states})")


def percent(value: float | None) -> str:
    """Return a rate of 0 to 1 in percent, `-` without one."""
    return "-" if value is None else f"{100 * value:.1f}"


def _percent_interval(interval: tuple[float, float] | None) -> str:
    return "-" if interval is None else f"{100 * interval[0]:.0f}-{100 * interval[1]:.0f}"


def print_checks(title: str, checks: "Iterable[tuple[str, str, str, str]]") -> None:
    """Print a table of checks: name, result, style of the result, and finding of each."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(title=Text(title))
    for column in ("check", "", "what was found"):
        table.add_column(column, no_wrap=column != "what was found")
    for name, result, style, finding in checks:
        table.add_row(name, Text(result, style=style), Text(finding))
    Console().print(table)


@contextmanager
def status(text: str) -> "Iterator[Callable[[str], None]]":
    """Show a moving line; the yielded function adds a text to it."""
    from rich.console import Console

    console = Console(stderr=True)
    with console.status(text) as status:
        yield lambda name: status.update(f"{text}: {name}")


@contextmanager
def progress_bar(description: str) -> "Iterator[Callable[..., None]]":
    """Show a progress bar; the yielded function takes the numbers of done and of all, and may take a description."""
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
        line = bar.add_task(description, total=None)

        def show(num_done: int, num_all: int, latest: str = "") -> None:
            bar.update(line, completed=num_done, total=num_all, description=latest or description)

        yield show


@contextmanager
def progress() -> "Iterator[Callable[[Progress], None]]":
    """Show a progress bar over stages; the yielded function updates it."""
    with progress_bar("stages") as show:
        yield lambda state: show(state.num_done, state.num_stages, "" if state.latest is None else state.latest.label)


@contextmanager
def generation_progress() -> "Iterator[Callable[[GenerationProgress], None]]":
    """Show a progress bar over houses on a terminal, else print a line each minute."""

    def line(state: "GenerationProgress") -> str:
        left_s = state.seconds * (1.0 - state.share) / state.share if state.share else float("inf")
        return f"{100 * state.share:.0f}%: {_counts(state)}, about {left_s / 60:.0f} min left"

    with _bar_or_lines("starting", 1.0) as show:
        yield lambda state: show(state.share, _counts(state), lambda: line(state))


@contextmanager
def house_progress(count: int) -> "Iterator[Callable[[MakingProgress], None]]":
    """Show a progress bar over houses that are made on a terminal, else print a line each minute."""
    with _bar_or_lines("houses", float(count)) as show:
        yield lambda state: show(
            float(state.num_houses), "houses", lambda: f"{state.num_houses} of {counted(count, 'house')}"
        )


@contextmanager
def _bar_or_lines(description: str, total: float) -> "Iterator[Callable[[float, str, Callable[[], str]], None]]":
    """Show a progress bar on a terminal, else print a line each minute.

    Yields:
        A function of what is done, the bar's description, and a function that writes the line.
    """
    from rich import progress as bars
    from rich.console import Console

    from evonav.api.progress import bar_columns

    console = Console(stderr=True)
    if not console.is_terminal:
        printed_s = time.monotonic()

        def tell(_done: float, _description: str, line: "Callable[[], str]") -> None:
            nonlocal printed_s
            if time.monotonic() - printed_s >= LINE_EVERY_S:
                printed_s = time.monotonic()
                typer.echo(line(), err=True)

        yield tell
        return
    with bars.Progress(*bar_columns(), console=console) as bar:
        task = bar.add_task(description, total=total)
        yield lambda done, description, _: bar.update(task, completed=done, description=description)


def _counts(state: "GenerationProgress") -> str:
    failed = f", {state.num_failed} failed" if state.num_failed else ""
    rejected = f"{counted(state.num_rejected, 'house')} rejected"
    return f"{counted(state.num_tasks, 'task')} ({state.tasks_per_s:.1f}/s), {rejected}{failed}"


@contextmanager
def interruptible(out: Path) -> "Iterator[None]":
    """Say how to resume when the command is interrupted by Ctrl-C or by a scheduler's SIGTERM."""

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    except KeyboardInterrupt:
        typer.echo(f"interrupted; finished stages are in {out}; run the same command again to resume", err=True)
        raise typer.Exit(EXIT_INTERRUPTED) from None
