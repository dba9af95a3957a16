"""Run a section and show its figures: as a table, as Markdown, and compared with an earlier run."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from evonav._core import __version__
from evonav.errors import InvalidArgumentError
from evonav.report.machine import machine_name
from evonav.report.tables.numbers import NONE
from evonav.report.tables.table import Table
from evonav.speed_benchmark.records import Row, Speeds
from evonav.speed_benchmark.timing import Sampling
from evonav.statistics import BeforeAfter, ClusterBootstrap, Interval

FACTOR = 1.25
"""Growth of a time from which on it counts as worse."""
NUM_RESAMPLES = 2000


class Section(Protocol):
    """A module that measures something."""

    NAME: str
    """Word of the command."""
    TITLE: str
    NOTES: str
    """Description of the measurement, in Markdown."""
    measure: Callable[..., Iterator[Row]]
    """Takes a `Sampling` and the section's own options."""


@dataclass(frozen=True, slots=True)
class Timing:
    """One time of a run, or its ratio to a peer's."""

    value: float
    by_house: Mapping[str, float] = field(default_factory=dict)
    """The same number of each house alone, where it is known."""


def run_section(
    section: Section,
    sampling: Sampling,
    *,
    on_row: Callable[[Row], None] = lambda _: None,
    **options: Any,  # noqa: ANN401 - the section's own
) -> Speeds:
    """Measure a section.

    Args:
        section: One of the modules of this package.
        sampling: The inputs, the peers, and the number of measurements.
        on_row: Called with every row when it is finished.
        **options: Arguments of the section's own `measure`.

    Raises:
        EvonavError: A peer is missing or computes something else, or a part of evonav fails.
    """
    rows = []
    for row in section.measure(sampling, **options):
        rows.append(row)
        on_row(row)
    return Speeds(
        section=section.NAME,
        title=section.TITLE,
        notes=section.NOTES,
        evonav=__version__,
        machine=machine_name(),
        repeats=sampling.repeats,
        rows=rows,
        left_out=sampling.left_out,
    )


def speed_table(title: str, rows: list[Row], notes: tuple[str, ...] = ()) -> Table:
    """Build the table of a section; columns that no row fills are left out."""
    columns: dict[str, list[str]] = {
        "row": [row.operation for row in rows],
        "ms p50": [f"{row.ms:.3g}" for row in rows],
        "95%": [_interval(row.ms_ci95) for row in rows],
        "peer": [row.peer or NONE for row in rows],
        "its ms": [_number(row.peer_ms) for row in rows],
        "ratio": [_number(row.ratio) for row in rows],
        "ratio 95%": [_interval(row.ratio_ci95) for row in rows],
    }
    for name in dict.fromkeys(name for row in rows for name in row.facts):
        columns[name] = [_number(row.facts.get(name)) for row in rows]
    shown = {name: cells for name, cells in columns.items() if name in ("row", "ms p50") or set(cells) != {NONE}}
    return Table(title, tuple(shown), tuple(zip(*shown.values(), strict=True)), notes)


def table_of(speeds: Speeds) -> Table:
    """Build the table of a run, which names the machine and the peers that are missing."""
    notes = [
        f"CPU time, the median; ratio: the peer's over evonav's, above 1 evonav is faster. Intervals: 95%, by house. "
        f"Measured on {speeds.machine}, evonav {speeds.evonav}.",
        *(f"Without {name}: {why}" for name, why in speeds.left_out.items()),
    ]
    return speed_table(speeds.title, speeds.rows, tuple(notes))


def markdown_of(speeds: Speeds) -> str:
    """Return title, notes and table of a run."""
    return f"# {speeds.title}\n{speeds.notes.strip()}\n\n{table_of(speeds).markdown()}"


def against(before: Speeds, now: Speeds) -> list[BeforeAfter]:
    """Compare a run with an earlier one, row by row.

    On another machine, times are compared as multiples of the peers', and rows without a peer are left out.

    Raises:
        InvalidArgumentError: The runs are of different sections.
    """
    if before.section != now.section:
        raise InvalidArgumentError(f"figures of {before.section!r} cannot be compared with those of {now.section!r}")
    is_same = before.machine == now.machine
    return changes(_figures(before, is_same=is_same), _figures(now, is_same=is_same))


def _figures(speeds: Speeds, *, is_same: bool) -> dict[str, Timing]:
    found = {}
    for row in speeds.rows:
        if is_same:
            found[f"{row.operation}, ms"] = Timing(row.ms, row.ms_by_house)
        elif row.ratio:
            found[f"{row.operation}, over {row.peer}"] = Timing(1 / row.ratio)
    return found


def _number(value: float | None) -> str:
    return NONE if value is None else f"{value:.0f}" if abs(value) >= 100 else f"{value:.3g}"


def _interval(ends: Interval | None) -> str:
    return NONE if ends is None else f"{_number(ends[0])}-{_number(ends[1])}"


def changes(before: Mapping[str, Timing], now: Mapping[str, Timing]) -> list[BeforeAfter]:
    """Compare the figures that both runs have.

    A figure is worse if it has grown by more than a quarter. Where both runs know at least two of the same houses, it
    must have grown within houses by the whole of the 95% interval, too.

    Returns:
        In the order of `now`; figures that only one run has are left out.
    """
    return [
        BeforeAfter(name, before[name].value, timing.value, _is_worse(before[name], timing))
        for name, timing in now.items()
        if name in before
    ]


def _is_worse(before: Timing, now: Timing) -> bool:
    interval = _growth_ci95(before, now)
    return now.value > FACTOR * before.value and (interval is None or interval[0] > 0)


def _growth_ci95(before: Timing, now: Timing) -> Interval | None:
    """Return the interval of the mean growth within houses, as a logarithm."""
    houses = [house for house, value in now.by_house.items() if value > 0 and before.by_house.get(house, 0.0) > 0]
    if len(houses) < 2:
        return None
    growth = np.log([now.by_house[house] / before.by_house[house] for house in houses])
    return ClusterBootstrap(houses, num_resamples=NUM_RESAMPLES).column_means(growth[:, None])[0].ci95
