"""The page of a run: `report.html` holds everything, or links to a page a task when there are many."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from evonav.errors import StoreError
from evonav.evaluation.metrics import AgentSummary, Interval
from evonav.evaluation.records import EndState, StageRecord
from evonav.report import tables
from evonav.report.causes import Cause, cause_of, sentence
from evonav.report.legend import legend
from evonav.report.maps import change_words, map_css, map_name, outcome_words, stage_svg, task_frame
from evonav.report.overlay import change, course, rounds
from evonav.report.plan import Frame, furniture, ground, item_labels, labels, moving_ids
from evonav.report.run import Run, Task, load_run
from evonav.report.svg import clean, join, slug

MAX_INLINE_STAGES = 400
"""Recorded stages up to which `report.html` holds every map; beyond, each task has a page of its own."""
REPORT_NAME = "report.html"
TASK_DIR = "tasks"
MAP_DIR = "maps"


@dataclass(frozen=True, slots=True)
class Cell:
    """A stage of an agent in a task's grid."""

    state: str
    words: str
    sentence: str
    facts: str
    rounds: list[str]
    svg: Markup
    change: str


@dataclass(frozen=True, slots=True)
class TaskView:
    """A task as the template shows it."""

    anchor: str
    task_id: str
    house: str
    num_rooms: int
    defs: Markup
    goals: list[tuple[int, StageRecord | None, str, str | None]]
    """Stage, a record that tells the goal, what changed before, and the reference image as a data URI."""
    rows: list[tuple[str, list[Cell]]]
    data: dict[str, str]


def write_report(run_dir: Path, out_dir: Path | None = None) -> Path:
    """Writes `report.html`, `table.md`, `table.csv` and, for runs that are not large, `maps/*.svg`.

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
        (out_dir / "table.csv").write_text(tables.summary_csv(run.summaries), encoding="utf-8")
        is_paged = run.num_recorded > MAX_INLINE_STAGES
        views = _paged_views(run, out_dir) if is_paged else _inline_views(run, out_dir)
        page = _environment().get_template("report.html.j2")
        path = out_dir / REPORT_NAME
        with path.open("w", encoding="utf-8") as file:
            for part in page.generate(**_page_context(run), views=views, is_paged=is_paged):
                file.write(part)
    except OSError as error:
        raise StoreError(f"{out_dir}: {error}") from error
    return path


def markdown_tables(run: Run) -> str:
    """All tables of a run as one Markdown text."""
    return "\n".join(f"## {table.title}\n\n{table.markdown()}" for table in run_tables(run) if table.rows)


def run_tables(run: Run) -> list[tables.Table]:
    """All tables of a run, in reading order."""
    records = run.records_by_agent()
    return [
        tables.headline(run.summaries),
        tables.paired_table(run.pairs),
        tables.stage_table(records),
        tables.relocation_table(run.summaries),
        tables.mode_table(run.summaries),
        tables.cause_count_table(run.cause_counts()),
    ]


def _inline_views(run: Run, out_dir: Path) -> Iterator[TaskView]:
    """Views for the page itself, each stage's map also written as a file."""
    maps = out_dir / MAP_DIR
    for i, task in enumerate(run.tasks()):
        for record in task.records.values():
            maps.mkdir(exist_ok=True)
            drawn = stage_svg(record, task.maps, success_radius_m=run.success_radius_m)
            (maps / map_name(record)).write_text(drawn, encoding="utf-8")
        yield task_view(run, task, f"h{i}")


def _paged_views(run: Run, out_dir: Path) -> Iterator[TaskView]:
    """Writes a page a task; nothing is left for the index to hold but its overview."""
    pages = out_dir / TASK_DIR
    pages.mkdir(exist_ok=True)
    template = _environment().get_template("task.html.j2")
    context = {"css": _text("report.css") + map_css(), "js": _text("report.js"), "legend": legend()}
    for task in run.tasks():
        view = task_view(run, task, "h")
        (pages / f"{view.anchor}.html").write_text(template.render(view=view, **context), encoding="utf-8")
    yield from ()


def task_view(run: Run, task: Task, prefix: str) -> TaskView:
    """Draws a task: the house once, what moves once a stage, every agent's stages over them."""
    records = list(task.records.values())
    frame = task_frame(task.maps, records)
    shared = list(task.maps.values())
    moving = moving_ids(shared)
    defs = []
    if shared:
        fixed = [item for item in shared[0].objects if item.object_id not in moving]
        defs.append(_shared(prefix, ground(shared[0], frame, moving)))
        defs.append(_shared(f"{prefix}n", labels(shared[0], frame)))
        defs.append(_shared(f"{prefix}f", item_labels(fixed, frame)))
    for stage, stage_map in task.maps.items():
        items = [item for item in stage_map.objects if item.object_id in moving]
        told = next((record for record in records if record.stage == stage), None)
        changed = "" if told is None else _changed(told, task, frame)
        defs.append(_shared(f"{prefix}s{stage}", furniture(items, frame) + changed))
        defs.append(_shared(f"{prefix}f{stage}", item_labels(items, frame)))
    stages = range(1, task.num_stages + 1)

    def cell(agent: str, stage: int) -> Cell:
        record = task.records.get((agent, stage))
        if record is None:
            return Cell("not_run", "no record yet", "This stage has no record yet.", "", [], Markup(""), "")
        below = _uses(prefix, stage) if stage in task.maps else _changed(record, task, frame)
        name = clean(f"Map of stage {stage} for {agent}")
        opening = Markup('<svg class="map" viewBox="{}" role="img" aria-label="{}">').format(frame.view_box, name)
        drawn = opening + Markup(below + course(record, frame, run.success_radius_m) + "</svg>")  # noqa: S704
        return Cell(
            record.state.value,
            outcome_words(record),
            sentence(record),
            _facts(record),
            rounds(record.trace),
            drawn,
            change_words(record, task.maps),
        )

    goals = []
    for stage in stages:
        told = next((task.records[agent, stage] for agent in run.agents if (agent, stage) in task.records), None)
        image = task.maps[stage].reference_image if stage in task.maps else None
        goals.append((stage, told, "" if told is None else change_words(told, task.maps), image))
    return TaskView(
        anchor=slug(task.task_id),
        task_id=task.task_id,
        house=records[0].house if records else "",
        num_rooms=len(shared[0].rooms) if shared else 0,
        defs=Markup(join(defs)),  # noqa: S704 - our own SVG
        goals=goals,
        rows=[(agent, [cell(agent, stage) for stage in stages]) for agent in run.agents],
        data=_filter_data(run, task.task_id),
    )


def _shared(name: str, drawing: str) -> str:
    """A group that many pictures show; style rules reach into it from its own root only, hence the class."""
    return f'<g class="map" id="{name}">{drawing}</g>'


def _uses(prefix: str, stage: int) -> str:
    """A stage's house from its shared groups; names of furniture (`fine`) are for large pictures."""
    ids = (prefix, f"{prefix}s{stage}", f"{prefix}n")
    fine = (f"{prefix}f", f"{prefix}f{stage}")
    return join([f'<use href="#{name}"/>' for name in ids] + [f'<use class="fine" href="#{name}"/>' for name in fine])


def _changed(record: StageRecord, task: Task, frame: Frame) -> str:
    maps = task.maps
    return change(record.transition, frame, stage_map=maps.get(record.stage), previous_map=maps.get(record.stage - 1))


def _facts(record: StageRecord) -> str:
    """Figures of a stage in a line."""
    parts = [f"{record.num_rounds} rounds"]
    if record.path_length_m is not None:
        shortest = "" if record.reference_length_m is None else f" (shortest {record.reference_length_m:.1f} m)"
        parts.append(f"{record.path_length_m:.1f} m{shortest}")
    parts.append(f"target seen in {record.num_target_visible_rounds}")
    num_stale = sum(entry.is_stale for entry in record.entries)
    if record.entries:
        parts.append(f"{len(record.entries)} entries, {num_stale} stale")
    return " · ".join(parts)


def _filter_data(run: Run, task_id: str) -> dict[str, str]:
    """What the page's filters look at: `data-*` attributes of a task."""
    outcomes = {key: outcome for key, outcome in run.outcomes.items() if key[1] == task_id}
    return _filter_attributes(run, outcomes, task_id)


def _filter_attributes(run: Run, outcomes: Mapping[tuple[str, str, int], Any], task_id: str) -> dict[str, str]:
    states = {key: outcome.record.state for key, outcome in outcomes.items()}
    num_disagreements = 0
    for stage in range(1, run.num_stages[task_id] + 1):
        found = {states.get((agent, task_id, stage)) for agent in run.agents}
        num_disagreements += EndState.SUCCESS in found and len(found) > 1
    causes = sorted({outcome.cause.name for outcome in outcomes.values() if outcome.cause is not None})
    words = {outcome.record.goal.category.lower() for outcome in outcomes.values()}
    return {
        "task": slug(task_id),
        "failures": str(sum(state is not EndState.SUCCESS for state in states.values())),
        "disagreements": str(num_disagreements),
        "causes": " ".join(causes),
        "words": " ".join([task_id.lower(), *sorted(words)]),
    }


def _page_context(run: Run) -> dict[str, Any]:
    by_task: dict[str, dict[tuple[str, str, int], Any]] = {task_id: {} for task_id in run.num_stages}
    for key, outcome in run.outcomes.items():
        by_task[key[1]][key] = outcome
    overview = [
        {
            "anchor": slug(task_id),
            "task_id": task_id,
            "data": _filter_attributes(run, by_task[task_id], task_id),
            "agents": [
                [(stage, *_mark(by_task[task_id].get((agent, task_id, stage)))) for stage in range(1, num_stages + 1)]
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
        "causes": [cause for cause in Cause if cause in used],
        "facts": _run_facts(run),
        "css": _text("report.css") + map_css(),
        "js": _text("report.js"),
        "legend": legend(),
        "task_dir": TASK_DIR,
    }


def statements(run: Run) -> list[str]:
    """What the run shows, in sentences that claim no more than the intervals allow."""
    scored = sorted((s for s in run.summaries if s.sr is not None), key=lambda s: -(s.sr or 0.0))
    if not scored:
        return ["No stage has been scored yet."]
    best = scored[0]
    equal = [summary.agent for summary in scored if summary.sr == best.sr]
    if len(equal) > 1:
        lines = [f"{' and '.join(equal)} have the same success rate, {tables.percent(best.sr, None)} %."]
    else:
        measured = tables.percent(best.sr, best.sr_ci95)
        lines = [f"{best.agent} has the highest success rate, {measured} % of {best.n} stages."]
    pairs = [pair for pair in run.pairs if best.agent in (pair.a, pair.b)]
    if pairs and all(pair.num_tasks < tables.MIN_TASKS_FOR_VERDICT for pair in pairs):
        lines.append(f"{pairs[0].num_tasks} tasks are too few to tell agents apart.")
        return lines
    for pair in pairs:
        lines.append(
            f"{pair.b} less {pair.a}: {tables.points(pair.sr, pair.sr_ci95)} points on the {pair.n} stages that both "
            f"scored: {tables.verdict(pair)}."
        )
    return lines


def _mark(outcome: Any) -> tuple[str, str]:  # noqa: ANN401 - StageOutcome or None
    """State and tooltip of an overview square."""
    if outcome is None:
        return ("none", "no record yet")
    record = outcome.record
    why = "" if outcome.cause is None or outcome.cause.value == record.state.value else f": {outcome.cause.value}"
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
    if run.mean_wall_s is not None:
        facts.append(("mean wall time a stage", f"{run.mean_wall_s:.2f} s (not part of the records)"))
    return facts


def _json(value: object) -> str:
    return value if isinstance(value, str) else json.dumps(value, sort_keys=True)


def _text(name: str) -> Markup:
    """A file of the package, trusted as it is."""
    text = (files("evonav.report") / "templates" / name).read_text(encoding="utf-8")
    return Markup(text)  # noqa: S704 - our own file


def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("evonav.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=lambda value: clean(value) if isinstance(value, str) and not isinstance(value, Markup) else value,
    )
    environment.filters["cause_of"] = cause_of
    return environment
