"""Load a run in a notebook: `evonav.load("out/run").stages`."""

from collections.abc import Iterable, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

from evonav.component import optional_module
from evonav.evaluation.records.store import RunStore
from evonav.report.export import ROUND_COLUMNS, round_table, stage_columns, stage_table

Columns = dict[str, list[Any]]
"""Values by column, all of one length: `pandas.DataFrame(columns)` and `polars.DataFrame(columns)` take it."""


class LoadedRun:
    """A run's stages and rounds as columns, read when they are first asked for."""

    def __init__(self, run_dir: Path | str) -> None:
        """Open a run.

        Args:
            run_dir: Its folder.

        Raises:
            StoreError: There is no run there.
        """
        self.run_dir = Path(run_dir)
        with RunStore(self.run_dir) as store:
            self.config: Mapping[str, Any] = store.meta("config") or {}
            recorded = {agent for agent, _, _ in store.states()}
        self.agents: tuple[str, ...] = tuple(sorted(recorded))

    def __repr__(self) -> str:
        return f"LoadedRun({str(self.run_dir)!r}, agents={self.agents!r})"

    @cached_property
    def stages(self) -> Columns:
        """One row a recorded stage: the fields of `evonav.evaluation.metrics.stage_metrics.StageMetrics`."""
        return _columns(stage_table(self.run_dir), stage_columns())

    @cached_property
    def rounds(self) -> Columns:
        """One row a decision round: the columns of `evonav.report.export.ROUND_COLUMNS`."""
        return _columns(round_table(self.run_dir), ROUND_COLUMNS)

    def to_pandas(self, table: str = "stages") -> Any:  # noqa: ANN401 - pandas may not be there
        """Return `stages` or `rounds` as a DataFrame.

        Raises:
            StoreError: pandas is not installed.
        """
        pandas = optional_module("pandas", "a DataFrame needs pandas", "pandas")
        return pandas.DataFrame(self.rounds if table == "rounds" else self.stages)


def load(run_dir: Path | str) -> LoadedRun:
    """Return a run for a notebook.

    Args:
        run_dir: Folder of a run, finished or not.

    Raises:
        StoreError: There is no run there.
    """
    return LoadedRun(run_dir)


def _columns(rows: Iterable[Mapping[str, Any]], names: Iterable[str]) -> Columns:
    columns: Columns = {name: [] for name in names}
    for row in rows:
        for name, values in columns.items():
            values.append(row[name])
    return columns
