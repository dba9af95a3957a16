"""Show the progress of a sweep: a live table on a terminal, else lines."""

import time
from collections import Counter
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from evonav.counted import counted

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from rich.console import RenderableType

    from evonav.evaluation.run.run import Progress
    from evonav.sweeps.run import Cell, CellRun

COST_EVERY_S = 2.0
MAX_ROWS = 16
"""Largest number of cells in the table; the others are counted."""


@dataclass
class _CellState:
    num_stages: int
    num_done: int = 0
    num_failed: int = 0
    """Errored or not run."""
    num_new: int = 0
    """Recorded by this call."""
    began_s: float | None = None
    ended_s: float | None = None

    @property
    def is_done(self) -> bool:
        return self.num_done >= self.num_stages


@dataclass
class SweepProgress:
    """The progress of every cell, in the order of the file."""

    out: Path
    cells: "dict[str, _CellState]"
    began_s: float = field(default_factory=time.monotonic)
    _costs: "Mapping[str, float]" = field(default_factory=dict)
    _costs_read_s: float = -COST_EVERY_S

    @classmethod
    def of(cls, out: Path, runs: "Sequence[CellRun]") -> "SweepProgress":
        """Return the progress of these runs, as recorded in their folders."""
        progress = cls(out, {run.cell.name: _CellState(run.num_stages) for run in runs})
        for run in runs:
            state = progress.cells[run.cell.name]
            counts = _recorded(run.evaluation.run_dir, run.cell.agents)
            state.num_done = sum(counts.values())
            state.num_failed = counts["errored"] + counts["not_run"]
        return progress

    def take(self, cell: "Cell", progress: "Progress") -> bool:
        """Update a cell; return whether it is now finished."""
        state = self.cells[cell.name]
        was_done = state.is_done
        now_s = time.monotonic()
        state.num_done = progress.num_done
        if progress.latest is not None:
            state.began_s = state.began_s if state.began_s is not None else now_s
            state.num_new += 1
            state.num_failed += not progress.latest.is_scored
            state.ended_s = now_s
        return state.is_done and not was_done

    @property
    def num_done(self) -> int:
        """Number of stages with a record."""
        return sum(state.num_done for state in self.cells.values())

    @property
    def num_stages(self) -> int:
        """Number of stages of all cells."""
        return sum(state.num_stages for state in self.cells.values())

    def stages_per_s(self) -> float:
        """Return the rate since the command began."""
        num_new = sum(state.num_new for state in self.cells.values())
        return num_new / max(1e-9, time.monotonic() - self.began_s)

    def seconds_left(self) -> float:
        """Return the time left at the rate so far; `inf` while the rate is unknown."""
        rate = self.stages_per_s()
        return (self.num_stages - self.num_done) / rate if rate > 0 else float("inf")

    def costs(self) -> "Mapping[str, float]":
        """Return dollars by cell, read at most every `COST_EVERY_S`."""
        from evonav.decision.vlm.account import LEDGER_NAME, Ledger

        now_s = time.monotonic()
        path = self.out / LEDGER_NAME
        if now_s - self._costs_read_s >= COST_EVERY_S and path.is_file():
            self._costs_read_s = now_s
            ledger = Ledger(path)
            self._costs = {spent.model: spent.cost_usd for spent in ledger.spending()}
            ledger.close()
        return self._costs

    def line(self) -> str:
        """Return a line about the whole sweep."""
        num_cells = sum(state.is_done for state in self.cells.values())
        num_failed = sum(state.num_failed for state in self.cells.values())
        failed = f", {num_failed} failed" if num_failed else ""
        spent = sum(self.costs().values())
        cost = f", ${spent:.2f}" if spent else ""
        return (
            f"{self.num_done} of {self.num_stages} stages in {num_cells} of {len(self.cells)} cells{failed}, "
            f"{self.stages_per_s():.2f} stages/s, {duration(self.seconds_left())} left{cost}"
        )

    def cell_line(self, name: str) -> str:
        """Return a line about one cell."""
        state = self.cells[name]
        failed = f", {state.num_failed} failed" if state.num_failed else ""
        cost = self.costs().get(name, 0.0)
        return f"{name}: {state.num_done} of {state.num_stages} stages{failed}" + (f", ${cost:.2f}" if cost else "")

    def table(self) -> "RenderableType":
        """Return a table of running and nearby cells, and a line about the whole sweep."""
        from rich.console import Group
        from rich.table import Table
        from rich.text import Text

        costs = self.costs()
        table = Table(box=None, pad_edge=False, header_style="dim")
        table.add_column("cell", overflow="fold", ratio=1)
        for heading in ("done", "failed", "stages/s", "left", *(["cost"] if costs else [])):
            table.add_column(heading, justify="right", no_wrap=True)
        shown, num_before, num_after = self._shown()
        if num_before:
            table.add_row(Text(f"{counted(num_before, 'cell')} finished", style="dim"))
        for name in shown:
            state = self.cells[name]
            took_s = 0.0 if state.began_s is None else (state.ended_s or 0.0) - state.began_s
            rate = (state.num_new - 1) / took_s if took_s > 0 else 0.0
            left = "" if state.is_done or not rate else duration((state.num_stages - state.num_done) / rate)
            table.add_row(
                Text(name, style="green" if state.is_done else "bold" if state.num_new else "dim"),
                f"{state.num_done}/{state.num_stages}",
                Text(str(state.num_failed or ""), style="red"),
                f"{rate:.2f}" if rate else "",
                left,
                *([f"${costs.get(name, 0.0):.2f}"] if costs else []),
            )
        if num_after:
            table.add_row(Text(f"{counted(num_after, 'cell')} to come", style="dim"))
        return Group(table, Text(self.line(), style="bold"))

    def _shown(self) -> tuple[list[str], int, int]:
        """Return the cells to show, and the numbers of finished and waiting cells left out."""
        names = list(self.cells)
        if len(names) <= MAX_ROWS:
            return names, 0, 0
        active = [name for name in names if self.cells[name].num_new and not self.cells[name].is_done]
        waiting = [name for name in names if not self.cells[name].num_new and not self.cells[name].is_done]
        finished = [name for name in names if self.cells[name].is_done]
        shown = active[:MAX_ROWS]
        for more in (waiting[: MAX_ROWS // 3], finished[::-1], waiting[MAX_ROWS // 3 :]):
            shown += more[: MAX_ROWS - len(shown)]
        keep = set(shown)
        return (
            [name for name in names if name in keep],
            sum(name not in keep for name in finished),
            sum(name not in keep for name in (*waiting, *active)),
        )


@contextmanager
def showing(progress: SweepProgress) -> "Iterator[Callable[[Cell, Progress], None]]":
    """Show the progress, which the yielded function updates.

    A terminal shows a live table. Without one, a line is printed for each finished cell, and one for the whole sweep
    every minute.
    """
    from rich.console import Console
    from rich.live import Live

    from evonav.api.progress import LINE_EVERY_S

    console = Console(stderr=True)
    table = Live(get_renderable=progress.table, console=console, refresh_per_second=4, transient=True)
    printed_s = time.monotonic()

    def take(cell: "Cell", state: "Progress") -> None:
        nonlocal printed_s
        is_finished = progress.take(cell, state)
        if console.is_terminal:
            return
        if is_finished:
            typer.echo(progress.cell_line(cell.name), err=True)
        if time.monotonic() - printed_s >= LINE_EVERY_S:
            printed_s = time.monotonic()
            typer.echo(progress.line(), err=True)

    with table if console.is_terminal else nullcontext():
        yield take


def duration(seconds: float) -> str:
    """Return a duration as `40 s`, `12 min` or `3.5 h`."""
    if seconds == float("inf"):
        return "?"
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 90 * 60 else f"{seconds / 3600:.1f} h"


def _recorded(run_dir: Path, agents: "Sequence[str]") -> "Counter[str]":
    """Return the number of recorded stages by end state."""
    from evonav.evaluation.records.store import FILE_NAME, RunStore

    if not (run_dir / FILE_NAME).exists():
        return Counter()
    with RunStore(run_dir) as store:
        return Counter(state.value for (agent, _, _), state in store.states().items() if agent in agents)
