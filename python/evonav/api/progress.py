"""Show progress on a terminal or in a notebook, and nothing elsewhere."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich import progress as bars
from rich.console import Console


def bar_columns() -> tuple[bars.ProgressColumn, ...]:
    """Return the columns of a bar: description, bar, share, and the time passed and left."""
    return (
        bars.TextColumn("{task.description}"),
        bars.BarColumn(),
        bars.TaskProgressColumn(),
        bars.TimeElapsedColumn(),
        bars.TimeRemainingColumn(),
    )


@contextmanager
def progress_bar(description: str) -> Iterator[Callable[[float, float, str], None]]:
    """Show a progress bar; the yielded function takes what is done, all there is, and a description."""
    console = Console(stderr=True)
    if not (console.is_terminal or console.is_jupyter):
        yield lambda _done, _all, _text: None
        return
    with bars.Progress(*bar_columns(), console=console, transient=True) as bar:
        line = bar.add_task(description, total=None)
        yield lambda num_done, num_all, text: bar.update(
            line, completed=num_done, total=num_all, description=text or description
        )
