"""The page of a run: `report.html` holds everything, or links to a page a task when there are many."""

import json
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from evonav.errors import StoreError
from evonav.evaluation.metrics import AgentSummary
from evonav.report import tables
from evonav.report.cards import TaskView, filter_data, task_view
from evonav.report.causes import WORDS, Cause
from evonav.report.findings import latex_tables, markdown_tables, run_tables, statements
from evonav.report.legend import legend
from evonav.report.maps import map_css, map_name, outcome_words, stage_svg
from evonav.report.run import Run, StageOutcome, load_run
from evonav.report.svg import clean, slug
from evonav.significance import Interval

MAX_INLINE_STAGES = 400
"""Recorded stages up to which `report.html` holds every map; beyond, each task has a page of its own."""
REPORT_NAME = "report.html"
TASK_DIR = "tasks"
MAP_DIR = "maps"


def write_report(run_dir: Path, out_dir: Path | None = None) -> Path:
    """Writes `report.html`, `table.md`, `.tex`, `.csv` and, for runs that are not large, `maps/*.svg`.

    Deterministic but for wall-clock figures, safe on a run that is not finished or still being written.

    Args:
        run_dir: A run.
        out_dir: Where to; default the run's own folder.

    Returns:
        Path of the page.

    Raises:
        StoreError: There is no run, or a file cannot be read or written.
    """
    out_dir = out_dir or run_dir
    run = load_run(run_dir)
    try:
        out_dir.mkdir(parents=True, exist_ok=True)
        (out_dir / "table.md").write_text(markdown_tables(run), encoding="utf-8")
        (out_dir / "table.tex").write_text(latex_tables(run), encoding="utf-8")
        (out_dir / "table.csv").write_text(tables.summary_csv(run.summaries), encoding="utf-8")
        is_paged = run.num_recorded > MAX_INLINE_STAGES
        views = _paged_views(run, out_dir) if is_paged else _inline_views(run, out_dir)
        page = page_environment().get_template("report.html.j2")
        path = out_dir / REPORT_NAME
        with path.open("w", encoding="utf-8") as file:
            for part in page.generate(**_page_context(run), views=views, is_paged=is_paged):
                file.write(part)
    except OSError as error:
        raise StoreError(f"{out_dir}: {error}") from error
    return path


def _inline_views(run: Run, out_dir: Path) -> Iterator[TaskView]:
    """Views for the page itself, each stage's map also written as a file."""
    maps = out_dir / MAP_DIR
    for i, task in enumerate(run.tasks()):
        for record in task.records.values():
            maps.mkdir(exist_ok=True)
            drawn = stage_svg(record, task.maps, success_radius_m=run.success_radius_m)
            (maps / map_name(record)).write_text(drawn, encoding="utf-8")
        yield task_view(run, task, f"h{i}", "" if out_dir == run.run_dir else None)


def _paged_views(run: Run, out_dir: Path) -> Iterator[TaskView]:
    """Writes a page a task; nothing is left for the index to hold but its overview."""
    pages = out_dir / TASK_DIR
    pages.mkdir(exist_ok=True)
    template = page_environment().get_template("task.html.j2")
    context = {"css": text_of("report.css") + map_css(), "js": text_of("report.js"), "legend": legend()}
    for task in run.tasks():
        view = task_view(run, task, "h", "../" if out_dir == run.run_dir else None)
        (pages / f"{view.anchor}.html").write_text(template.render(view=view, **context), encoding="utf-8")
    yield from ()


def _page_context(run: Run) -> dict[str, Any]:
    overview = [
        {
            "anchor": slug(task_id),
            "task_id": task_id,
            "data": filter_data(run, task_id),
            "agents": [
                [(stage, *_mark(run.outcomes.get((agent, task_id, stage)))) for stage in range(1, num_stages + 1)]
                for agent in run.agents
            ],
        }
        for task_id, num_stages in run.num_stages.items()
    ]
    headline, *others = run_tables(run)
    used = {outcome.cause for outcome in run.outcomes.values()}
    return {
        "run": run,
        "name": run.run_dir.resolve().name,
        "headline": headline,
        "bars": [_bars(summary) for summary in run.summaries],
        "tables": [table for table in others if table.rows],
        "statements": statements(run),
        "overview": overview,
        "causes": [(cause.name, WORDS[cause]) for cause in Cause if cause in used],
        "facts": _run_facts(run),
        "css": text_of("report.css") + map_css(),
        "js": text_of("report.js"),
        "legend": legend(),
        "task_dir": TASK_DIR,
    }


def _mark(outcome: StageOutcome | None) -> tuple[str, str]:
    """State and tooltip of an overview square."""
    if outcome is None:
        return ("none", "no record yet")
    record = outcome.record
    why = f": {WORDS[outcome.cause]}" if outcome.cause is not None and record.is_scored else ""
    return (record.state.value, f"{record.goal.category}, {outcome_words(record)}{why}")


def _bars(summary: AgentSummary) -> list[Markup]:
    """SR and SPL with their interval on a scale of 0 to 100%."""
    return [_bar(summary.sr, summary.sr_ci95), _bar(summary.spl, summary.spl_ci95)]


def _bar(value: float | None, interval: Interval | None) -> Markup:
    if value is None:
        return Markup("")
    low, high = interval or (value, value)
    return Markup(
        '<svg class="bar" viewBox="0 0 100 10" preserveAspectRatio="none" aria-hidden="true">'
        '<rect class="track" width="100" height="10"/><rect class="value" width="{:.2f}" height="10"/>'
        '<path class="whisker" d="M{:.2f} 5H{:.2f}M{:.2f} 2V8M{:.2f} 2V8"/></svg>'
    ).format(100 * value, 100 * low, 100 * high, 100 * low, 100 * high)


def _run_facts(run: Run) -> list[tuple[str, str]]:
    """Name and value of what makes the run reproducible."""
    facts = [(key, _json(value)) for key, value in sorted(run.config.items())]
    facts += [("tasks recorded", str(len(run.num_stages))), ("agents", ", ".join(run.agents))]
    facts += [(f"sha256 of the records, {agent}", digest) for agent, digest in run.rows_sha256.items()]
    facts += [(f"mean wall time a stage, {agent}", f"{wall_s:.2f} s") for agent, wall_s in run.wall_s.items()]
    if run.retries:
        facts += [("stages tried again", ", ".join(f"{count} after {kind}" for kind, count in run.retries.items()))]
    return facts


def _json(value: object) -> str:
    return value if isinstance(value, str) else json.dumps(value, sort_keys=True)


def text_of(name: str) -> Markup:
    """A file of the package, trusted as it is."""
    text = (files("evonav.report") / "templates" / name).read_text(encoding="utf-8")
    return Markup(text)  # noqa: S704 - our own file


def page_environment() -> Environment:
    """The package's templates; text is escaped, and characters that no page may hold are replaced."""
    return Environment(
        loader=PackageLoader("evonav.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=lambda value: clean(value) if isinstance(value, str) and not isinstance(value, Markup) else value,
    )
