"""Write and read the figures of a section: `speed.json`."""

from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from evonav.errors import StoreError
from evonav.parallel.folders import write_atomically
from evonav.statistics import Interval

JSON_NAME = "speed.json"
MARKDOWN_NAME = "speed.md"


class Row(BaseModel):
    """One operation, alone or beside one peer."""

    model_config = ConfigDict(extra="forbid", frozen=True)

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


class Speeds(BaseModel):
    """The figures of one section, and where they were measured."""

    model_config = ConfigDict(extra="forbid")

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
    try:
        return Speeds.model_validate_json(path.read_bytes())
    except OSError as error:
        raise StoreError(f"{path}: cannot be read: {error.strerror or error}") from error
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"])) or "the file"
        raise StoreError(f"{path}: {where}: {first['msg']}; expected a speed.json of `evonav bench`") from error
