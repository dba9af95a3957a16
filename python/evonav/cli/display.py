"""Show tables, status lines and progress bars."""

import signal
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from evonav.counted import counted

EXIT_INTERRUPTED = 130

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
    from contextlib import AbstractContextManager

    from evonav.evaluation.metrics.navigation import AgentSummary
    from evonav.evaluation.run.run import Progress
    from evonav.generation.dataset import GenerationProgress
    from evonav.house.generated import MakingProgress
    from evonav.report.plots.specs import Plot
    from evonav.report.tables.table import Table


_GAP = 2
"""Width of the space between two columns of a table, in characters."""


def show_tables(tables: "Iterable[Table]", *, notes: "Sequence[str]" = ()) -> None:
    """Print tables of a report, then notes, those of all tables once.

    A table that is wider than the terminal is printed with rows as columns if that fits, else in parts, below each
    other. Agents of files and modules are shown by their classes.
    """
    from textwrap import fill

    from rich.console import Console
    from rich.measure import Measurement
    from rich.text import Text

    from evonav.report.tables.table import shortened

    console = Console()
    found = shortened(tables)
    for table in found:
        for part in in_parts(table, console.width):
            shown = part.rich()
            if Measurement.get(console, console.options.update(width=10_000), shown).maximum > console.width:
                for column, heading, texts in zip(shown.columns, part.columns, _texts(part), strict=True):
                    column.header = Text(fill(heading, max(1, *map(len, texts))))  # headings are wrapped, and no cell
            console.print(shown)
    every_note = [*(note for table in found for note in table.notes), *notes]
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
    from evonav.report.tables.table import Table

    title = "SR and SPL in % with 95% intervals; SR by whether the target moved"
    columns = ("agent", "n", "SR", "95%", "SPL", "95%", "moved", "not moved")
    rows = []
    for summary in summaries:
        ends = (
            "-" if ci is None else f"{100 * ci[0]:.0f}-{100 * ci[1]:.0f}" for ci in (summary.sr_ci95, summary.spl_ci95)
        )
        splits = (summary.splits.get(name) for name in ("relocated", "not_relocated"))
        moved = ("-" if rates is None else f"{percent(rates.sr)} ({rates.n})" for rates in splits)
        rows.append(
            (summary.agent, str(summary.n), percent(summary.sr), next(ends), percent(summary.spl), next(ends), *moved)
        )
    show_tables([Table(title, columns, tuple(rows))])
    for summary in summaries:
        if summary.is_incomplete:
            states = ", ".join(f"{count} {state}" for state, count in summary.counts.items() if count)
            typer.echo(f"incomplete: {summary.agent} has {summary.n} of {summary.num_stages} stages ({states})")


def percent(value: float | None) -> str:
    """Return a rate of 0 to 1 in percent, `-` without one."""
    return "-" if value is None else f"{100 * value:.1f}"


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


def progress_bar(description: str) -> "AbstractContextManager[Callable[..., None]]":
    """Show a progress bar on a terminal, else a line each minute; see `evonav.api.progress`."""
    from evonav.api.progress import progress_bar

    return progress_bar(description, is_command=True)


@contextmanager
def progress() -> "Iterator[Callable[[Progress], None]]":
    """Show a progress bar over stages; the yielded function updates it."""
    with progress_bar("stages") as show:
        yield lambda state: show(state.num_done, state.num_stages, state.label)


@contextmanager
def generation_progress() -> "Iterator[Callable[[GenerationProgress], None]]":
    """Show progress over tasks that are generated; the yielded function updates it."""

    def counts(state: "GenerationProgress") -> str:
        failed = f", {state.num_failed} failed" if state.num_failed else ""
        rejected = f"{counted(state.num_rejected, 'house')} rejected"
        return f"{counted(state.num_tasks, 'task')} ({state.tasks_per_s:.1f}/s), {rejected}{failed}"

    with progress_bar("starting") as show:
        yield lambda state: show(state.share, 1.0, counts(state))


@contextmanager
def house_progress(count: int) -> "Iterator[Callable[[MakingProgress], None]]":
    """Show progress over houses that are made; the yielded function updates it."""
    with progress_bar("houses") as show:
        yield lambda state: show(state.num_houses, count)


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
