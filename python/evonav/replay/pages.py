"""Write the pages of `evonav view`: an episode round by round, one self-contained HTML file each, and their index.

What is drawn comes from `evonav.replay.types`; no agent, model or task is read here.
"""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from markupsafe import Markup

from evonav.drawing.floor_plan import PlanFrame, floors, furniture, item_labels, labels, structure
from evonav.drawing.svg import cm
from evonav.errors import InvalidArgumentError
from evonav.evaluation.records.floor_plans import FloorPlan
from evonav.parallel.folders import write_atomically
from evonav.replay.page_data import PageData
from evonav.replay.types import ReplayedStage
from evonav.report.maps.legend import entries_of, legend
from evonav.report.maps.moments import Moment, moments
from evonav.report.maps.stage_map import page_name, task_frame
from evonav.report.maps.text import describe_outcome
from evonav.report.maps.trajectory import change, end_mark, ring, start_mark, target_mark
from evonav.report.pages.replays import LIST_NAME, ListedPage, listed_pages, page_code, viewer_css
from evonav.report.pages.template import page_text, text_of

INDEX_NAME = "index.html"
MAX_PAGE_BYTES = 10_000_000
"""An episode whose page would be larger is written a stage a page."""
_SHARED_MARKS = ("start", "end, success", "end, no success", "target", "where it stood in stage 1", "success radius")


def write_episode(
    stages: Sequence[ReplayedStage],
    out_dir: Path,
    *,
    budget: int,
    success_radius_m: float,
    only: int | None = None,
    records_sha256: str = "",
) -> list[ListedPage]:
    """Write an episode's page, or one per stage where one would be too large.

    Args:
        success_radius_m: Radius of the ring around the target.
        only: The one stage to show.
        records_sha256: Digest of the episode's records as stored.

    Raises:
        InvalidArgumentError: The one stage has no record.
        StoreError: A file cannot be written.
    """
    shown = [stage for stage in stages if only is None or stage.record.stage == only]
    if not shown:
        raise InvalidArgumentError(f"no record of stage {only}")
    maps = {stage.record.stage: stage.floor_plan for stage in stages if stage.floor_plan is not None}
    page = _page(shown, maps, _tabs(shown, shown), budget, success_radius_m)
    if len(page.encode()) <= MAX_PAGE_BYTES or len(shown) == 1:
        return [_write(page, shown, out_dir, only, records_sha256)]
    pages = []
    for stage in shown:
        text = _page([stage], maps, _tabs(shown, [stage]), budget, success_radius_m)
        pages.append(_write(text, [stage], out_dir, stage.record.stage, records_sha256))
    return pages


def write_index(pages: Iterable[ListedPage], out_dir: Path, run_name: str) -> Path:
    """Write `index.html`, which links to these pages and to those that were written there before."""
    rows = {page.href: page for page in listed_pages(out_dir)}
    rows |= {page.href: page for page in pages}
    ordered = sorted(rows.values(), key=lambda row: (row.task_id, row.agent, row.stages[0][0]))
    write_atomically(out_dir / LIST_NAME, json.dumps([asdict(row) for row in ordered], indent=1) + "\n")
    index = page_text("viewer_index.html.j2", text_of("report.css"), name=run_name, rows=ordered)
    return write_atomically(out_dir / INDEX_NAME, index)


def _tabs(stages: Sequence[ReplayedStage], here: Sequence[ReplayedStage]) -> list[tuple[str, int, str, int]]:
    """State, number, page of those that are on another one, and index of those that are on this."""
    tabs, index = [], 0
    for stage in stages:
        record = stage.record
        is_here = any(stage is other for other in here)
        href = "" if is_here else page_name(record.task_id, record.agent, record.stage)
        tabs.append((record.state.value, record.stage, href, index))
        index += is_here
    return tabs


def _page(
    stages: Sequence[ReplayedStage],
    maps: Mapping[int, FloorPlan],
    tabs: Sequence[tuple[str, int, str, int]],
    budget: int,
    radius_m: float,
) -> str:
    first = stages[0].record
    frame = task_frame(maps, [stage.record for stage in stages])
    data = PageData()
    for stage in stages:
        data.add_stage(stage, maps, frame, budget)
    return page_text(
        "viewer.html.j2",
        viewer_css(),
        text_of("viewer.js"),
        task_id=first.task_id,
        house=first.house,
        agent=first.agent,
        tabs=tabs,
        drawings=[
            part for index, stage in enumerate(stages) for part in _drawings(index, stage, maps, frame, radius_m)
        ],
        view_box=frame.view_box,
        legend=_legend(),
        data=Markup(data.text()),  # noqa: S704 - JSON without `<`
    )


def _drawings(
    index: int, stage: ReplayedStage, maps: Mapping[int, FloorPlan], frame: PlanFrame, radius_m: float
) -> list[dict[str, Any]]:
    """Return the layers of a stage's map in each of its moments, and the rounds in which they are shown."""
    parts = moments(stage.record, maps)
    ends = [*(part.first_round for part in parts[1:]), None]
    return [
        {"of": index, "first": part.first_round, "until": until, **_layers(part, frame, radius_m)}
        for part, until in zip(parts, ends, strict=True)
    ]


def _layers(moment: Moment, frame: PlanFrame, radius_m: float) -> dict[str, Markup]:
    """Return the layers of a map that are the same in all rounds of a moment."""
    record, maps = moment.record, moment.maps
    floor_plan = maps.get(record.stage)
    ends = ""
    if (start := record.effective_start) is not None:
        ends += start_mark(cm((start.x_m, start.z_m)), frame, "start")
    if (end := record.terminal) is not None:
        ends += (
            f'<g class="terminal">{end_mark(cm((end.x_m, end.z_m)), record.state.value == "success", frame.unit)}</g>'
        )
    house = floor_plan or FloorPlan(
        task_id=record.task_id, house=record.house, stage=record.stage, rooms=(), walls=(), openings=(), objects=()
    )
    layers = {
        "floors": floors(house),
        "furniture": furniture(house.objects, frame),
        "structure": structure(house, frame),
        "names": item_labels(house.objects, frame) + labels(house, frame),
        "change": change(record, maps, frame),
        "target": ring(record, frame, radius_m) + target_mark(record.target, frame),
        "ends": ends,
    }
    return {name: Markup(layer) for name, layer in layers.items()}  # noqa: S704 - our own SVG


def _legend() -> Markup:
    box = 'x="4" y="5" width="16" height="14" stroke-width="1.6"'
    agent = (
        (
            "agent, and where its views look",
            '<path class="fov heading" d="M14 20L4 6A17 17 0 0 1 24 6Z"/>'
            '<g class="agent"><circle cx="14" cy="19" r="4"/></g>',
            28,
        ),
        ("way so far", '<g class="path" stroke-width="4"><path class="t3" d="M3 12h22"/></g>', 28),
        ("this round's step", '<path class="step" stroke-width="4" d="M3 12h22"/>', 28),
        ("entry", f'<g class="entry"><rect {box}/></g>', 24),
        ("candidate of a question", f'<g class="entry candidate"><rect {box}/></g>', 24),
        ("chosen", f'<g class="entry chosen"><rect {box}/></g>', 24),
        ("likely place of the target", '<rect class="heat" fill-opacity=".6" x="4" y="4" width="16" height="16"/>', 24),
        ("frontier", '<g class="frontier"><path d="M12 4l7 14l-7 -4l-7 4z"/></g>', 24),
        ("chosen frontier", '<g class="frontier chosen"><path d="M12 4l7 14l-7 -4l-7 4z"/></g>', 24),
        ("free, explored", '<rect class="cell-explored" x="2" y="4" width="20" height="16"/>', 24),
        ("free", '<rect class="cell-free" x="2" y="4" width="20" height="16"/>', 24),
        ("blocked", '<rect class="cell-blocked" x="2" y="4" width="20" height="16"/>', 24),
        ("unknown", '<rect class="cell-unknown" x="2" y="4" width="20" height="16"/>', 24),
    )
    evaluator = (
        (
            "stale entry, and where its object stands now",
            f'<g class="entry stale"><rect {box}/><path d="M8 8l8 8m0 -8l-8 8" stroke-width="1.6"/></g>'
            '<g class="now" stroke-width="1.6"><path d="M20 12h22"/><circle cx="45" cy="12" r="4"/></g>',
            54,
        ),
        *entries_of(*_SHARED_MARKS),
        *entries_of("object moved before this stage"),
    )
    heading = Markup('<b class="what">{}</b>')
    return (
        heading.format("The agent's")
        + legend(agent)
        + heading.format("Evaluator's knowledge; no agent sees it")
        + legend(evaluator)
    )


def _write(
    text: str, stages: Sequence[ReplayedStage], out_dir: Path, only: int | None, records_sha256: str
) -> ListedPage:
    records = [stage.record for stage in stages]
    first = records[0]
    path = write_atomically(out_dir / page_name(first.task_id, first.agent, only), text)
    return ListedPage(
        agent=first.agent,
        task_id=first.task_id,
        href=path.name,
        stages=[[record.stage, record.state.value, describe_outcome(record)] for record in records],
        differs=any(stage.differences for stage in stages),
        records_sha256=records_sha256,
        code=page_code(),
    )
