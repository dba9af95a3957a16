"""Build tables of a run, as Markdown, CSV, LaTeX (booktabs), HTML cells and for a terminal.

Rates are in percent with their 95% interval by house; a row with errored or not-run stages says
*incomplete* in words, since its rates are not final.
"""

import io
import re
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from html import escape
from shutil import get_terminal_size

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.measure import Measurement
from rich.table import Table as RichTable
from rich.text import Text

from evonav.evaluation.metrics.navigation import AgentSummary, Rates, rates
from evonav.evaluation.metrics.stage_metrics import RecordMetrics
from evonav.evaluation.records.schema import DURING_STRATA
from evonav.report.export import csv_text
from evonav.report.tables.causes import CAUSE_NAMES, FailureCause
from evonav.report.tables.numbers import NONE, rate
from evonav.statistics import NUM_RESAMPLES

INTERVALS = (
    f"95% bootstrap intervals over houses ({NUM_RESAMPLES:,} resamples). – means that there are too few different "
    "houses for one."
)
SPL_NOTE = (
    "SPL is the length of the shortest path to the target divided by that of the walked path, at most 1. A success may "
    "stop short of the target by up to the success radius, so a walked path can be shorter than the shortest path."
)
STRICT_NOTE = (
    "Strict success: the agent called stop within 1 m of the target's box, with the target in view. Most agents look "
    "at an object from 1.5 m by design, so their strict rates are low."
)
STATES = ("success", "failure", "errored", "not_run")
"""Ends of stages that tables count."""
OWN_AGENT = re.compile(r"(?<![\w/.])(?:[\w.~/\\-]*\.py|[A-Za-z_][\w.]*):([A-Z]\w*)")
"""Name of an agent that is a class of a file or module, such as `./mine.py:Mine`, and the class."""


@dataclass(frozen=True, slots=True, repr=False)
class Table:
    """Rows of text under headers; the first column is left-aligned, the others right-aligned."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...] = ()
    best: frozenset[tuple[int, int]] = frozenset()
    """(row, column) of cells to stress."""

    def markdown(self) -> str:
        """Return the table in GitHub's syntax, with its notes below."""
        (shown,) = shortened([self])
        lines = [shown.columns, ("---", *["---:"] * (len(shown.columns) - 1)), *shown._cells(_markdown_text, "**{}**")]
        text = "\n".join(f"| {' | '.join(cells)} |" for cells in lines)
        return text + "".join(f"\n\n{_markdown_text(note)}" for note in shown.notes) + "\n"

    def latex(self) -> str:
        """Return a `tabular` for `booktabs`: best values bold, notes as comments, no wider than the line."""
        (shown,) = shortened([self])
        head, *rows = [tuple(map(latex_text, shown.columns)), *shown._cells(latex_text, r"\textbf{{{}}}")]
        lines = [f"% {_one_line(shown.title)}", _NO_WIDER_THAN_THE_LINE]
        lines += [
            rf"\begin{{tabular}}{{l{'r' * (len(head) - 1)}}}",
            r"\toprule",
            " & ".join(head) + r" \\",
            r"\midrule",
        ]
        lines += [" & ".join(cells) + r" \\" for cells in rows]
        lines += [r"\bottomrule", r"\end{tabular}}", "", *(f"% {_one_line(note)}" for note in shown.notes)]
        return "\n".join(lines) + "\n"

    def __repr__(self) -> str:
        """Return the table as text, as wide as the terminal."""
        (shown,) = shortened([self])
        table, text = shown.rich(), io.StringIO()
        for column, *cells in zip(table.columns, shown.columns, *shown.rows, strict=True):
            column.min_width = max(len(word) for cell in cells for word in cell.split() or ("",))  # no word is broken
        console = Console(file=text, width=sys.maxsize, height=100)  # without a height, COLUMNS overrides the width
        least = Measurement.get(console, console.options, table).minimum + 2 * len(self.columns)  # with gaps
        console.width = max(least, get_terminal_size((120, 24)).columns)
        console.print(table)
        return "\n".join(line.rstrip() for line in text.getvalue().splitlines())

    def _repr_html_(self) -> str:
        (shown,) = shortened([self])
        head = "".join(f"<th>{escape(column)}</th>" for column in shown.columns)
        rows = ("".join(f"<td>{cell}</td>" for cell in cells) for cells in shown._cells(escape, "<b>{}</b>"))
        body = "".join(f"<tr>{cells}</tr>" for cells in rows)
        notes = "".join(f"<p><small>{escape(note)}</small></p>" for note in shown.notes)
        table = f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
        return f"<p><b>{escape(shown.title)}</b></p>{table}{notes}"

    def _cells(self, written: Callable[[str], str], stressed: str) -> list[tuple[str, ...]]:
        """Return the rows in a format; `stressed` is the format of the best cells."""
        return [
            tuple(
                stressed.format(written(cell)) if (i, j) in self.best else written(cell) for j, cell in enumerate(row)
            )
            for i, row in enumerate(self.rows)
        ]

    def rich(self) -> RichTable:
        """Return the table for `rich.print`."""
        notes = "\n".join(self.notes)
        table = RichTable(
            title=Text(self.title),
            title_justify="left",
            caption=Text(notes),
            caption_justify="left",
            box=SIMPLE_HEAD,
            padding=(0, 1, 0, 0),
            pad_edge=False,
        )
        for j, column in enumerate(self.columns):
            table.add_column(Text(column), justify="left" if j == 0 else "right", overflow="fold")
        for i, row in enumerate(self.rows):
            table.add_row(*(Text(cell, style="bold" if (i, j) in self.best else "") for j, cell in enumerate(row)))
        return table


def short_names(texts: Iterable[str]) -> dict[str, str]:
    """Return the class of each agent in texts that is named by file or module, where no other has the same class.

    This is the name of the agent wherever people read it; files for other programs have the whole name.
    """
    found = {match[0]: match[1] for text in texts for match in OWN_AGENT.finditer(text)}
    classes = list(found.values())
    return {name: short for name, short in found.items() if classes.count(short) == 1}


def renamed(text: str, names: Mapping[str, str]) -> str:
    """Return a text with names in place of others."""
    for name, new in names.items():
        text = text.replace(name, new)
    return text


def shortened(tables: Iterable[Table]) -> list[Table]:
    """Return tables with the short names of agents, and the whole names in notes."""
    found = list(tables)
    names = short_names(text for table in found for row in (table.columns, *table.rows) for text in row)
    return [_renamed(table, names) for table in found] if names else found


def _renamed(table: Table, names: Mapping[str, str]) -> Table:
    texts = " ".join(text for row in (table.columns, *table.rows) for text in row)
    return replace(
        table,
        title=renamed(table.title, names),
        columns=tuple(renamed(text, names) for text in table.columns),
        rows=tuple(tuple(renamed(text, names) for text in row) for row in table.rows),
        notes=(
            *(renamed(note, names) for note in table.notes),
            *(f"{short} is {name}." for name, short in names.items() if name in texts),
        ),
    )


def markdown_tables(tables: Iterable[Table]) -> str:
    """Return tables under their titles, as one Markdown text."""
    return "\n".join(f"## {table.title}\n\n{table.markdown()}" for table in shortened(tables))


def latex_tables(tables: Iterable[Table]) -> str:
    """Return tables as LaTeX, for the package `booktabs`."""
    return "\n".join(table.latex() for table in shortened(tables))


def headline(summaries: Sequence[AgentSummary]) -> Table:
    """Build a table with one row per agent: SR, SPL, n, and the stages by end state."""
    columns = ("Agent", "SR % [95% CI]", "SPL % [95% CI]", "n", "success", "failure", "errored", "not run", "stages")
    rows = tuple(
        (
            summary.agent,
            rate(summary.sr, summary.sr_ci95),
            rate(summary.spl, summary.spl_ci95),
            str(summary.n),
            *(str(summary.counts.get(state, 0)) for state in STATES),
            f"{summary.n} of {summary.num_stages}, incomplete"
            if summary.is_incomplete
            else f"all {summary.num_stages}",
        )
        for summary in summaries
    )
    notes = [f"{INTERVALS} Rates are over stages that ended in success or failure."]
    incomplete = [summary.agent for summary in summaries if summary.is_incomplete]
    if incomplete:
        notes.append(f"Incomplete: {', '.join(incomplete)}. Some stages errored or were not run; rates are not final.")
    notes.append(SPL_NOTE)
    # Rates over different stages have no best.
    best = [] if incomplete else _best([s.sr for s in summaries], 1) + _best([s.spl for s in summaries], 2)
    return Table("Success rate and SPL", columns, rows, tuple(notes), frozenset(best))


MODES = {
    "static": "static",
    "salient_object": "salient object",
    "retain_group": "retained group",
    "full_shuffle": "full shuffle",
    "activities": "daily activities",
    "extensions": "other extensions",
}
"""Kinds of the transition before a stage, in reading order, and their titles."""


def mode_words(mode: str) -> str:
    """Return an evolution mode, such as `RETAIN_GROUP`, in words."""
    return MODES.get(mode.lower(), mode)


SPLIT_TITLES = {
    "stage_1": "stage 1",
    "relocated": "moved",
    "not_relocated": "not moved",
    "target_moved_during": "target moved during the stage",
    "changed_during": "other things did",
    "unchanged_during": "nothing did",
    **MODES,
}
"""The splits of `AgentSummary`, in reading order."""


SPLIT_TABLES = {
    "By whether the target moved": (
        ("stage_1", "relocated", "not_relocated"),
        "Moved: the target had moved since stage 1, at any time. Both columns are of stages 2 and later.",
    ),
    "By evolution before the stage": (tuple(MODES), "Stages 2 and later."),
    "By change during the stage": (
        DURING_STRATA,
        "A change during the stage that had not come when the agent stopped is no change during it.",
    ),
}
"""Tables of SR by splits of the stages: title, splits, and a note."""


def split_tables(summaries: Sequence[AgentSummary]) -> list[Table]:
    """Build the tables of SR by split, without columns for splits that no agent has; the last only if there is one."""
    tables = []
    for title, (wanted, note) in SPLIT_TABLES.items():
        names = [name for name in wanted if any(name in summary.splits for summary in summaries)]
        if names or wanted is not DURING_STRATA:
            cells = {s.agent: [s.rates(name) for name in names] for s in summaries}
            tables.append(_rates_table(title, [SPLIT_TITLES[name] for name in names], cells, (note,)))
    return tables


def stage_table(rows: Mapping[str, Sequence[RecordMetrics]]) -> Table:
    """Build the table of SR by stage index."""
    stages = sorted({row.stage for part in rows.values() for row in part})
    cells = {
        agent: [rates([row for row in part if row.stage == stage]) for stage in stages] for agent, part in rows.items()
    }
    return _rates_table("By stage", [f"stage {k}" for k in stages], cells, ())


def cause_table(counts: Mapping[str, Mapping[FailureCause | None, int]]) -> Table:
    """Build a table of the stages without success by cause, from counts by agent."""
    causes = [cause for cause in FailureCause if any(part.get(cause) for part in counts.values())]
    rows = tuple((CAUSE_NAMES[cause], *(str(part.get(cause, 0)) for part in counts.values())) for cause in causes)
    note = "Each stage has one cause, the first that fits."
    return Table("Why stages failed", ("Cause", *counts), rows, (note,))


def summary_csv(summaries: Sequence[AgentSummary]) -> str:
    """Return every metric, unrounded: one CSV row per agent and split."""
    ends = [f"{name}_{end}" for name in ("sr", "sr_wilson", "spl") for end in ("low", "high")]
    totals = ("soft_spl", *STATES, "num_stages", "num_tasks")
    rows: list[list[object]] = []
    for s in summaries:
        whole = [s.soft_spl, *(s.counts.get(state, 0) for state in STATES), s.num_stages, s.num_tasks]
        for name in ("all", *s.splits):
            part = s.rates(name)
            sr, wilson, spl = (ci95 or (None, None) for ci95 in (part.sr_ci95, part.sr_wilson95, part.spl_ci95))
            shown = whole if name == "all" else [None] * len(whole)
            rows.append([s.agent, name, part.n, part.sr, *sr, *wilson, part.spl, *spl, *shown, s.is_incomplete])
    return csv_text(("agent", "split", "n", "sr", *ends[:4], "spl", *ends[4:], *totals, "is_incomplete"), rows)


def _rates_table(
    title: str, titles: Sequence[str], cells: Mapping[str, Sequence[Rates]], notes: tuple[str, ...]
) -> Table:
    rows = tuple((agent, *map(rates_text, row)) for agent, row in cells.items())
    return Table(title, ("Agent", *titles), rows, ("SR % [95% CI], n stages.", *notes))


def rates_text(part: Rates) -> str:
    """Return a success rate with its interval and the number of stages."""
    return NONE if part.n == 0 else f"{rate(part.sr, part.sr_ci95)}, n = {part.n}"


def _best(values: Sequence[float | None], column: int) -> list[tuple[int, int]]:
    """Return the cells of the largest value, if there are two to compare and not all are equal."""
    known = [value for value in values if value is not None]
    if len(known) < 2 or min(known) == max(known):
        return []
    return [(i, column) for i, value in enumerate(values) if value == max(known)]


def _markdown_text(text: str) -> str:
    return re.sub(r"([\\|*_<\[\]])", r"\\\1", _one_line(text)).replace(r"\[", "[").replace(r"\]", "]")


_NO_WIDER_THAN_THE_LINE = r"\noindent\resizebox{\ifdim\width>\linewidth\linewidth\else\width\fi}{!}{%"
_LATEX = {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "–": "--",
    **{character: f"\\{character}" for character in "&%$#_{}"},
}


def latex_text(text: str) -> str:
    """Text as LaTeX shows it."""
    return "".join(_LATEX.get(character, character) for character in _one_line(text))


def _one_line(text: str) -> str:
    return " ".join(text.split())
