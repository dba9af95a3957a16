"""Write the page of a run: one file with its tables, every stage's map, and episodes round by round."""

import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup

from evonav.drawing.style import map_css
from evonav.drawing.svg import slug
from evonav.parallel.folders import replacing, write_atomically
from evonav.report.maps.legend import legend
from evonav.report.maps.stage_map import VIEW_DIR, map_name, stage_svg
from evonav.report.maps.text import describe_outcome
from evonav.report.pages.replays import highlights_first, listed_pages, viewer_css
from evonav.report.pages.task_cards import filter_data, task_view
from evonav.report.pages.template import packed, page_environment, policy, rate_bar, text_of
from evonav.report.plots.render import plot_elements
from evonav.report.plots.style import plot_css
from evonav.report.run import RecordedRun, RecordedStage, load_run
from evonav.report.tables import table as tables
from evonav.report.tables.causes import CAUSE_NAMES, FailureCause
from evonav.report.tables.run_metadata import failure_groups, reproduction, run_facts, task_digests
from evonav.report.tables.run_tables import Breakdowns, run_breakdowns, run_plots, run_tables, statements

MAX_OPEN_STAGES = 400
"""Recorded stages up to which maps stand in the page as they are; beyond, each task is packed until it is looked at."""
MAX_REPLAY_BYTES = 16_000_000
"""Episodes round by round are part of the page up to this size; beyond, the page links to their files."""
REPORT_NAME = "report.html"
MAP_DIR = "maps"


def write_report(
    run_dir: Path | RecordedRun,
    out_dir: Path | None = None,
    *,
    has_maps: bool = False,
    max_replay_bytes: int = MAX_REPLAY_BYTES,
) -> Path:
    """Write `report.html`, which needs no other file, and `table.md`, `.tex`, `.csv`.

    Deterministic except for wall-clock times, safe on a run that is not finished or still being written. Pages that
    `evonav view` left in the run's folder become part of the report, as long as they show the records of now.

    Args:
        run_dir: A run, or what was read of it.
        out_dir: Folder to write to; default the run's own folder.
        has_maps: Write every stage's map as a file of its own too, `maps/*.svg`.
        max_replay_bytes: Limit for the pages of `evonav view` in the report; it links to those that do not fit.
    """
    run = run_dir if isinstance(run_dir, RecordedRun) else load_run(run_dir)
    out_dir = out_dir or run.run_dir
    breakdowns = run_breakdowns(run)
    found = run_tables(run, breakdowns)
    with_rows = [table for table in found if table.rows]
    write_atomically(out_dir / "table.md", tables.markdown_tables(with_rows))
    write_atomically(out_dir / "table.tex", tables.latex_tables(with_rows))
    write_atomically(out_dir / "table.csv", tables.summary_csv(run.summaries))
    replays = _replays(run, out_dir, max_replay_bytes)
    page = page_environment().get_template("report.html.j2")
    path = out_dir / REPORT_NAME
    with replacing(path) as beside, beside.open("w", encoding="utf-8") as file:
        tasks = _tasks(run, replays, out_dir / MAP_DIR if has_maps else None)
        for text in page.generate(
            **_template_values(run, found, breakdowns, has_replays=bool(replays)), tasks=tasks, replays=replays
        ):
            file.write(text)
    return path


def _replays(run: RecordedRun, out_dir: Path, max_bytes: int) -> list[dict[str, Any]]:
    """Return the pages of `evonav view` that show this run's records, the highlights first.

    Each has its `page`, its packed `content` (`None` where it is a file beside the report), and its `stages`: number,
    state, words and address.
    """
    view_dir = run.run_dir / VIEW_DIR
    order = {episode: i for i, episode in enumerate(highlights_first(run))}
    pages = [
        page
        for page in listed_pages(view_dir)
        if run.episodes_sha256.get((page.agent, page.task_id)) == page.records_sha256
    ]
    pages.sort(key=lambda page: (order[page.agent, page.task_id], page.stages[0][0]))
    found = []
    for page in pages:
        content = packed((view_dir / page.href).read_text(encoding="utf-8")) if page.is_current else None
        if content is not None and len(content) > max_bytes:
            content = None
        max_bytes -= 0 if content is None else len(content)
        file = os.path.relpath(view_dir / page.href, out_dir).replace(os.sep, "/")
        where = f"#replay={page.href}&" if content is not None else f"{file}#"
        stages = [(k, state, outcome, f"{where}stage={k}&round=1") for k, state, outcome in page.stages]
        found.append({"page": page, "content": content, "stages": stages})
    return found


def _tasks(
    run: RecordedRun, replays: list[dict[str, Any]], map_dir: Path | None
) -> Iterator[tuple[dict[str, Any], Markup, bool]]:
    """Yield every task's view and section, and whether the section is packed."""
    is_packed = run.num_recorded > MAX_OPEN_STAGES
    hrefs = {
        (replay["page"].agent, replay["page"].task_id, stage): href
        for replay in replays
        for stage, _, _, href in replay["stages"]
    }
    macros: Any = page_environment().get_template("macros.html.j2").module
    for i, task in enumerate(run.tasks()):
        if map_dir is not None:
            for record in task.records.values():
                drawn = stage_svg(record, task.maps, success_radius_m=run.success_radius_m)
                write_atomically(map_dir / map_name(record), drawn)
        view = task_view(run, task, f"h{i}", hrefs)
        section = macros.task_section(view)
        yield view, packed(section) if is_packed else section, is_packed


def _template_values(
    run: RecordedRun, found: Sequence[tables.Table], breakdowns: Breakdowns, *, has_replays: bool
) -> dict[str, Any]:
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
    headline, *others = tables.shortened(found)
    shown = [table for table in others if table.rows]
    plots, failures = run_plots(run, breakdowns), failure_groups(run)
    sections = [
        ("rates", headline.title),
        *([("replays", "Round by round")] if has_replays else []),
        *([("plots", "Plots")] if plots else []),
        *((f"table-{number}", table.title) for number, table in enumerate(shown, 1)),
        ("episodes", "Episodes"),
        *([("failures", "Errors")] if failures else []),
        ("settings", "Settings"),
    ]
    used = {outcome.cause for outcome in run.outcomes.values()}
    columns = "".join(f".k{k}{{--k:{k}}}" for k in sorted(set(run.num_stages.values())))
    css = text_of("report.css") + map_css() + plot_css() + columns
    js = text_of("sortable.js") + text_of("report.js")
    return {
        "run": run,
        "name": run.run_dir.resolve().name,
        "headline": headline,
        "bars": [(rate_bar(s.sr, s.sr_ci95), rate_bar(s.spl, s.spl_ci95)) for s in run.summaries],
        "others": shown,
        "sections": sections,
        "plots": list(
            zip(
                plot_elements([plot for plot, _ in plots], are_even=True),
                (caption for _, caption in plots),
                strict=False,
            )
        ),
        "statements": [tables.renamed(line, run.names) for line in statements(run)],
        "overview": overview,
        "causes": [(cause.name, CAUSE_NAMES[cause]) for cause in FailureCause if cause in used],
        "facts": run_facts(run),
        "failures": failures,
        "commands": reproduction(run),
        "digests": task_digests(run),
        "css": css,
        "js": js,
        "policy": policy((css, viewer_css()), (js, text_of("viewer.js"))),
        "legend": legend(),
    }


def _mark(outcome: RecordedStage | None) -> tuple[str, str]:
    """State and tooltip of an overview square."""
    if outcome is None:
        return ("none", "no record yet")
    row = outcome.row
    why = f": {CAUSE_NAMES[outcome.cause]}" if outcome.cause is not None and row.is_scored else ""
    return (row.state, f"{outcome.category}, {describe_outcome(row)}{why}")
