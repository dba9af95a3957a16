"""A run in Python: `evonav.evaluate` and `evonav.load_run` return one."""

import warnings
from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from functools import cached_property
from pathlib import Path
from typing import Any

from evonav.component import optional_module
from evonav.errors import EvonavError, InvalidArgumentError, StoreError
from evonav.evaluation.records.store import FILE_NAME, RunStore
from evonav.replay.run_pages import unwritten_highlights, write_pages
from evonav.report.compare.compare import compare
from evonav.report.compare.selection import agents_of
from evonav.report.compare.wording import comparison_table
from evonav.report.export import ROUND_COLUMNS, round_table, stage_columns, stage_table
from evonav.report.pages.replays import highlight_task
from evonav.report.pages.run_page import write_report
from evonav.report.run import RecordedRun
from evonav.report.run import load_run as read_run
from evonav.report.tables.table import Table, headline

Columns = dict[str, list[Any]]
"""Values by column, all of one length: `pandas.DataFrame(columns)` and `polars.DataFrame(columns)` take it."""


class Run:
    """A run, finished or not: its tables, pages and rows, read from its folder when they are first asked for.

    Examples:
        >>> import evonav
        >>> run = evonav.evaluate("stay-still", "random-walk", limit=1, workers=0)
        >>> table = run.summary()
        >>> table.columns[:3]
        ('Agent', 'SR % [95% CI]', 'SPL % [95% CI]')
        >>> len(run.stages["success"])
        8
        >>> difference = run.compare("random-walk", "stay-still")
    """

    path: Path
    """Folder of the run."""
    config: Mapping[str, Any]
    """Settings that decide the records: seed, protocol, simulator, perception, decision model."""

    def __init__(self, path: str | Path) -> None:
        """Open a run.

        Raises:
            StoreError: There is no run there.
        """
        self.path = Path(path)
        with RunStore(self.path) as store:
            self.config = store.meta("config") or {}

    @cached_property
    def _recorded(self) -> RecordedRun:
        return read_run(self.path)

    @property
    def agents(self) -> tuple[str, ...]:
        """Names of the agents: the paper's in the order of its tables, then the others."""
        return self._recorded.agents

    @cached_property
    def stages(self) -> Columns:
        """One row a recorded stage: the fields of `evonav.evaluation.metrics.stage_metrics.StageMetrics`."""
        return _columns(stage_table(self.path), stage_columns())

    @cached_property
    def rounds(self) -> Columns:
        """One row a decision round: the columns of `evonav.report.export.ROUND_COLUMNS`."""
        return _columns(round_table(self.path), ROUND_COLUMNS)

    def to_pandas(self, table: str = "stages") -> Any:  # noqa: ANN401 - pandas may not be there
        """Return `stages` or `rounds` as a DataFrame.

        Raises:
            InvalidArgumentError: There is no such table.
            StoreError: pandas is not installed.
        """
        if table not in ("stages", "rounds"):
            raise InvalidArgumentError(f"table = {table!r}: expected `stages` or `rounds`")
        pandas = optional_module("pandas", "a DataFrame needs pandas", "pandas")
        return pandas.DataFrame(self.rounds if table == "rounds" else self.stages)

    def summary(self) -> Table:
        """Return SR and SPL of every agent with 95% intervals, and how many stages there are."""
        return headline(self._recorded.summaries)

    def compare(self, a: str, b: str) -> Table:
        """Return the differences of agent `a` minus agent `b` on the stages that both finished.

        Args:
            a: Name of an agent, or of its class.

        Raises:
            InvalidArgumentError: The run has no such agent.
        """
        names = (self._agent(a), self._agent(b))
        if names[0] == names[1]:
            raise InvalidArgumentError(f"`{a}` is compared with itself; the agents are {', '.join(self.agents)}")
        (found,) = compare(agents_of(self._recorded, names), baseline=names[1])
        return comparison_table(found)

    def report(self, out: str | Path | None = None, replays: int = 2) -> Path:
        """Write the report, `report.html` and its tables, and return the path of the page.

        Args:
            out: Folder to write. Default: the run's own.
            replays: Number of episodes to replay for it, those that show most; a warning says if that fails.
        """
        try:
            if missing := unwritten_highlights(self._recorded, replays):
                write_pages(self._recorded, missing)
        except EvonavError as error:  # a report needs only the records
            warnings.warn(f"no replays: {error}", stacklevel=2)
        return write_report(self.path, None if out is None else Path(out))

    def view(self, agent: str | None = None, task: str | None = None) -> Path:
        """Replay episodes of one task, write a page for each, and return the path of the page that shows them.

        Args:
            agent: The only agent to show, by its name or that of its class. Default: all.
            task: Id of a task. Default: one that shows the agents' differences best.

        Raises:
            InvalidArgumentError: The run has no such agent or task.
            TaskError: The task is no longer where the run found it.
        """
        agents = self.agents if agent is None else (self._agent(agent),)
        run = self._recorded
        if task is not None and task not in run.num_stages:
            raise InvalidArgumentError(_no_such("task", task, tuple(run.num_stages)))
        task = task or highlight_task(run, agents)
        pages, index = write_pages(run, [(name, task) for name in agents])
        return index.parent / pages[0].href if len(pages) == 1 else index

    def __repr__(self) -> str:
        """Return the folder and the agents."""
        return f"Run({str(self.path)!r}, agents={list(self.agents)})"

    def _repr_html_(self) -> str:
        return self.summary()._repr_html_()

    def _agent(self, name: str) -> str:
        """Return the agent of this name, or whose class has this name."""
        if name in self.agents:
            return name
        found = [agent for agent in self.agents if agent.rpartition(":")[2] == name]
        if len(found) == 1:
            return found[0]
        if found:
            raise InvalidArgumentError(f"several agents are called {name!r}: name one of {', '.join(found)}")
        raise InvalidArgumentError(_no_such("agent", name, self.agents))


def load_run(path: str | Path) -> Run:
    """Return a run from its folder.

    Args:
        path: Folder of a run, finished or not.

    Raises:
        StoreError: There is no run there.

    Examples:
        >>> import evonav
        >>> path = evonav.evaluate("stay-still", limit=1, workers=0).path
        >>> evonav.load_run(path).agents
        ('stay-still',)
    """
    folder = Path(path)
    if not folder.exists():
        raise StoreError(f"{folder}: there is no such folder")
    return Run(folder.parent if folder.name == FILE_NAME else folder)


def _no_such(what: str, name: str, known: tuple[str, ...]) -> str:
    near = get_close_matches(name, known, 1)
    there = f"did you mean `{near[0]}`?" if near else f"there are {', '.join(known)}"
    return f"the run has no {what} {name!r}; {there}"


def _columns(rows: Iterable[Mapping[str, Any]], names: Iterable[str]) -> Columns:
    columns: Columns = {name: [] for name in names}
    for row in rows:
        for name, values in columns.items():
            values.append(row[name])
    return columns
