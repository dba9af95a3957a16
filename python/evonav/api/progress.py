"""Show progress on a terminal or in a notebook; elsewhere commands print lines, and Python nothing."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich import progress as bars
from rich.console import Console

LINE_EVERY_S = 60.0
"""Seconds between two lines of progress where there is no terminal."""


@contextmanager
def progress_bar(description: str, *, is_command: bool = False) -> Iterator[Callable[..., None]]:
    """Show a progress bar, which a command leaves on the terminal; without one, a command prints a line each minute.

    Yields:
        A function of what is done, all there is, and a description, which may be left out. Fractions are shown as
        shares.
    """
    console = Console(stderr=True)
    if not (console.is_terminal or console.is_jupyter):
        yield _minutely(description) if is_command else lambda *_: None
        return
    columns = (
        bars.TextColumn("{task.description}"),
        bars.BarColumn(),
        bars.TextColumn("{task.fields[count]}", style="progress.percentage"),
        bars.TimeElapsedColumn(),
        bars.TimeRemainingColumn(),
    )
    with bars.Progress(*columns, console=console, transient=not is_command) as bar:
        line = bar.add_task(description, total=None, count="")

        def show(num_done: float, num_all: float, text: str = "") -> None:
            count = f"{num_done}/{num_all}" if isinstance(num_done, int) else f"{num_done / num_all:.0%}"
            bar.update(line, completed=num_done, total=num_all, count=count, description=text or description)

        yield show


def _minutely(description: str) -> Callable[..., None]:
    """Return a function that prints a line each minute."""
    began_s = printed_s = time.monotonic()
    num_before: float | None = None

    def tell(num_done: float, num_all: float, text: str = "") -> None:
        nonlocal printed_s, num_before
        now_s = time.monotonic()
        num_before = num_done if num_before is None else num_before
        if now_s - printed_s >= LINE_EVERY_S:
            printed_s, num_new = now_s, num_done - num_before
            left_min = (now_s - began_s) / 60 * (num_all - num_done) / num_new if num_new else float("inf")
            share = f"{100 * num_done / num_all:.0f}%: {text or description}"
            print(f"{share}, about {left_min:.0f} min left", file=sys.stderr)

    return tell
