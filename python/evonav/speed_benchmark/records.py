"""Write and read the figures of a section: `speed.json`."""

from pathlib import Path

from pydantic import Field

from evonav.parallel.folders import write_atomically
from evonav.report.measurements import MeasurementRecord, read_model
from evonav.statistics import Interval

JSON_NAME = "speed.json"
MARKDOWN_NAME = "speed.md"


class Row(MeasurementRecord):
    """One operation, alone or compared with one peer."""

    operation: str
    ms: float = Field(ge=0, allow_inf_nan=False)
    """Median of our times."""
    ms_ci95: Interval | None = None
    """95% interval by house; `None` of fewer than two houses."""
    ms_by_house: dict[str, float] = {}
    """Median of our times in each house."""
    n: int = Field(ge=1)
    """Number of measurements."""
    peer: str | None = None
    peer_ms: float | None = Field(default=None, ge=0, allow_inf_nan=False)
    """Median of the peer's times."""
    ratio: float | None = Field(default=None, ge=0, allow_inf_nan=False)
    """Median of the pairwise ratios peer / evonav: above 1 evonav is faster."""
    ratio_ci95: Interval | None = None
    facts: dict[str, float] = {}
    """Other figures, by their name with its unit."""


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
    left_out: dict[str, str] = {}
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
