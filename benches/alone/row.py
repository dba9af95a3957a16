"""Rows of the table of floors: a figure with its aim, and the parts of it that were measured alone."""

import gc
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from benches.versions.lines import milliseconds, pairwise
from evonav.speed_benchmark.timing import cpu_ms

HEAD = (
    "| work | aim | now | aim / now | alone | it takes | alone / now | what that leaves out |\n"
    "| --- | --- | ---: | ---: | --- | ---: | ---: | --- |"
)


@dataclass(frozen=True)
class Alone:
    """A part that was measured alone, in the turns of its figure."""

    what: str
    times_ms: Sequence[float]
    left_out: str


@dataclass(frozen=True)
class Figure:
    """What evonav takes now, turn by turn, and its aim."""

    work: str
    times_ms: Sequence[float]
    aim: str = ""
    aim_ms: Sequence[float] | None = None
    """The aim in each turn; `None` if it cannot be told from this run."""

    def rows(self, *parts: Alone) -> Iterator[str]:
        """Return a row a part in Markdown; the figure is in the first."""
        aim = "" if self.aim_ms is None else f"{pairwise(self.aim_ms, self.times_ms):.2f}"
        figure = [self.work, self.aim, milliseconds(self.times_ms), aim]
        for part in parts:
            share = f"{pairwise(part.times_ms, self.times_ms):.2f}"
            cells = [*figure, part.what, milliseconds(part.times_ms), share, part.left_out]
            yield f"| {' | '.join(cells)} |"
            figure = [""] * len(figure)


def in_turn(
    calls: Mapping[str, Callable[[int], object]],
    num: int,
    *,
    least_of: int = 1,
    prepare: Callable[[int], object] = lambda _: None,
) -> dict[str, list[float]]:
    """Return the CPU milliseconds of calls on inputs 0 to N - 1, every second time in reverse order.

    Args:
        calls: Called with the number of an input, by name.
        num: N.
        least_of: The fastest of so many calls in a row counts; the first of several is left out.
        prepare: Called with the number before each; not timed.
    """
    times_ms: dict[str, list[float]] = {name: [] for name in calls}
    gc.collect()
    gc.disable()
    try:
        for number in range(num):
            for name in list(calls)[:: 1 if number % 2 else -1]:
                prepare(number)
                found = [cpu_ms(calls[name], number) for _ in range(least_of)]
                times_ms[name].append(min(found[1:] or found))
    finally:
        gc.enable()
    return times_ms


def sums(*columns: Sequence[float]) -> list[float]:
    """Return the sums of parts, turn by turn."""
    return [sum(turn) for turn in zip(*columns, strict=True)]
