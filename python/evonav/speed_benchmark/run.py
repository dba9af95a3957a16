"""Run a section, keep its figures in a file, show them as a table, and compare them with an earlier run."""

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from pydantic import Field

from evonav._core import __version__
from evonav.errors import InvalidArgumentError
from evonav.parallel.folders import write_atomically
from evonav.report.machine import machine_name
from evonav.report.measurements import MeasurementRecord, read_model
from evonav.report.tables.numbers import NONE
from evonav.report.tables.table import Table
from evonav.speed_benchmark.timing import Row, Sampling
from evonav.statistics import BeforeAfter, ClusterBootstrap, Interval

FACTOR = 1.25
"""Growth of a time from which on it counts as worse."""
NUM_RESAMPLES = 2000


JSON_NAME, MARKDOWN_NAME = "speed.json", "speed.md"


class Speeds(MeasurementRecord):
    """The figures of one section, and where they were measured."""

    section: str
    title: str
    notes: str
    """Description of the measurement, in Markdown."""
    evonav: str
    """Version."""
    machine: str
    repeats: int
    rows: list[Row]
    left_out: dict[str, str] = Field(default_factory=dict)
    """Peers that were not run, with the reason."""


def write_speeds(speeds: Speeds, folder: Path, markdown: str) -> tuple[Path, Path]:
    """Write `speed.json` and `speed.md` into a folder of the section's name.

    Raises:
        StoreError: A file cannot be written.
    """
    here = folder / speeds.section
    text = speeds.model_dump_json(indent=2) + "\n"
    return write_atomically(here / JSON_NAME, text), write_atomically(here / MARKDOWN_NAME, markdown)


def read_speeds(path: Path) -> Speeds:
    """Read a `speed.json`.

    Raises:
        StoreError: The file cannot be read, or is none.
    """
    return read_model(Speeds, path, "expected a speed.json of `evonav bench`")


class Section(Protocol):
    """A module that measures something."""

    NAME: str
    """Word of the command."""
    TITLE: str
    NOTES: str
    """Description of the measurement, in Markdown."""
    measure: Callable[..., Iterator[Row]]
    """Takes a `Sampling` and the section's own options."""


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
    """Compare the rows that both runs have.

    A time is worse if it has grown by more than a quarter. Where both runs know at least two of the same houses, it
    must have grown within houses by the whole of the 95% interval, too. On another machine, times are compared as
    multiples of the peers', and rows without a peer are left out.

    Raises:
        InvalidArgumentError: The runs are of different sections.
    """
    if before.section != now.section:
        raise InvalidArgumentError(f"figures of {before.section!r} cannot be compared with those of {now.section!r}")
    earlier, latest = (_figures(one, has_times=before.machine == now.machine) for one in (before, now))
    return [
        BeforeAfter(name, earlier[name][0], value, _is_worse(*earlier[name], value, by_house))
        for name, (value, by_house) in latest.items()
        if name in earlier
    ]


def _figures(speeds: Speeds, *, has_times: bool) -> dict[str, tuple[float, Mapping[str, float]]]:
    """Return each time, also by house, or else its ratio to the peer's."""
    if has_times:
        return {f"{row.operation}, ms": (row.ms, row.ms_by_house) for row in speeds.rows}
    return {f"{row.operation}, over {row.peer}": (1 / row.ratio, {}) for row in speeds.rows if row.ratio}


def _is_worse(old: float, old_by_house: Mapping[str, float], new: float, by_house: Mapping[str, float]) -> bool:
    houses = [house for house, value in by_house.items() if value > 0 and old_by_house.get(house, 0.0) > 0]
    if new <= FACTOR * old or len(houses) < 2:
        return new > FACTOR * old
    growth = np.log([by_house[house] / old_by_house[house] for house in houses])
    ci95 = ClusterBootstrap(houses, num_resamples=NUM_RESAMPLES).column_means(growth[:, None])[0].ci95
    return ci95 is None or ci95[0] > 0


def _number(value: float | None) -> str:
    return NONE if value is None else f"{value:.0f}" if abs(value) >= 100 else f"{value:.3g}"


def _interval(ends: Interval | None) -> str:
    return NONE if ends is None else f"{_number(ends[0])}-{_number(ends[1])}"
