"""Draw a task as a strip, for a README or a paper: stages side by side, agents below each other."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from evonav.errors import InvalidArgumentError
from evonav.evaluation.records.schema import EndState, FloorPlan, StageRecord
from evonav.evaluation.records.store import RunStore
from evonav.report.maps.files import check_picture, write_picture
from evonav.report.maps.floor_plan import Frame
from evonav.report.maps.legend import legend_row
from evonav.report.maps.stage_map import (
    change_words,
    file_css,
    outcome_words,
    stage_drawing,
    success_radius_of,
    task_frame,
)
from evonav.report.maps.svg import escape, join, text_lines
from evonav.report.pages.highlights import best_highlight
from evonav.report.run import load_run
from evonav.report.tables.causes import sentence

PANEL_PX = 360
GAP_PX = 18
HEAD_PX = 112
FOOT_PX = 50
IMAGE_PX = 78


def write_strip(
    run_dir: Path, task_id: str | None, agents: str | Sequence[str], path: Path, *, stages: Sequence[int] | None = None
) -> Path:
    """Write a task as a strip.

    Args:
        run_dir: A run.
        task_id: One of its tasks; `None` for the `best_highlight` one.
        agents: One of its agents, or several: a row each.
        path: The `.svg`, `.png` or `.pdf` file to write.
        stages: Numbers of stages; default all that have a record (of the most telling task, three).

    Returns:
        `path`.

    Raises:
        InvalidArgumentError: The run has no such stage, or the file's suffix is of no format.
        StoreError: There is no run, it cannot be read, or the file cannot be written, or not without an extra.
    """
    check_picture(path)
    agents = [agents] if isinstance(agents, str) else list(agents)
    if task_id is None:
        task_id, default_stages = best_highlight(load_run(run_dir), agents)
        stages = stages or default_stages
    with RunStore(run_dir) as store:
        rows = [
            [record for record in store.records(agent, task_id) if stages is None or record.stage in stages]
            for agent in agents
        ]
        maps = {stage_map.stage: stage_map for stage_map in store.maps(task_id)}
        config = store.meta("config") or {}
    for agent, row in zip(agents, rows, strict=True):
        if not row:
            raise InvalidArgumentError(f"{run_dir}: no such stage of task {task_id!r} by agent {agent!r}")
    return write_picture(strip_svg(rows, maps, success_radius_m=success_radius_of(config)), path)


def strip_svg(rows: Sequence[Sequence[StageRecord]], maps: Mapping[int, FloorPlan], *, success_radius_m: float) -> str:
    """Return the strip: a row an agent, a column a stage."""
    everything = [record for row in rows for record in row]
    frame = task_frame(maps, everything)
    map_px = round(PANEL_PX * frame.height / frame.width)
    shown = {record.stage: record for record in reversed(everything)}
    left_px = {stage: GAP_PX + i * (PANEL_PX + GAP_PX) for i, stage in enumerate(sorted(shown))}
    width_px = GAP_PX + len(shown) * (PANEL_PX + GAP_PX)
    heads = join(_head(record, maps, left_px[stage]) for stage, record in sorted(shown.items()))
    panels = join(
        _panel(record, maps, frame, map_px, success_radius_m, left_px[record.stage], HEAD_PX + i * (map_px + FOOT_PX))
        for i, row in enumerate(rows)
        for record in row
    )
    legend, legend_px = legend_row(width_px - 2 * GAP_PX)
    top_px = HEAD_PX + len(rows) * (map_px + FOOT_PX) + 10
    height_px = top_px + legend_px + 8
    agents = ", ".join(dict.fromkeys(record.agent for record in everything))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" class="map" viewBox="0 0 {width_px} {height_px}" '
        f'width="{width_px}" height="{height_px}" role="img"><title>{escape(everything[0].task_id)}: {escape(agents)}'
        f'</title><style>{file_css()}</style><rect class="page" width="100%" height="100%" rx="10"/>{heads}{panels}'
        f'<g transform="translate({GAP_PX} {top_px})">{legend}</g></svg>\n'
    )


def _head(record: StageRecord, maps: Mapping[int, FloorPlan], left_px: int) -> str:
    """Draw the goal of a stage, its reference image, and what had changed."""
    image = None if record.stage not in maps else maps[record.stage].reference_image
    width = 54 if image is None else 38
    lines = join(
        f'<text class="instruction" y="{48 + 17 * i}">{escape(line)}</text>'
        for i, line in enumerate(text_lines(record.goal.instruction, width, 3))
    )
    changed = text_lines(change_words(record, maps), 56, 1)[0]
    css = "quiet" if record.transition.kind == "static" else "change-words"
    shown = (
        ""
        if image is None
        else f'<image href="{escape(image)}" x="{PANEL_PX - IMAGE_PX}" y="10" width="{IMAGE_PX}" height="{IMAGE_PX}"/>'
    )
    return (
        f'<g transform="translate({left_px} 0)"><text class="stage" y="27">Stage {record.stage}</text>{lines}{shown}'
        f'<text class="{css}" y="{HEAD_PX - 7}">{escape(changed)}</text></g>'
    )


def _panel(
    record: StageRecord,
    maps: Mapping[int, FloorPlan],
    frame: Frame,
    map_px: int,
    success_radius_m: float,
    left_px: int,
    top_px: int,
) -> str:
    verdict = {EndState.SUCCESS: "ok", EndState.FAILURE: "bad"}.get(record.state, "quiet")
    drawing = stage_drawing(record, maps, frame, success_radius_m, has_item_names=False)
    why = text_lines(sentence(record), 60, 1)[0]
    return (
        f'<g transform="translate({left_px} {top_px})"><svg width="{PANEL_PX}" height="{map_px}" '
        f'viewBox="{frame.view_box}">{drawing}</svg>'
        f'<text class="verdict" y="{map_px + 18}"><tspan class="ink">{escape(record.agent)}</tspan> '
        f'<tspan class="{verdict}">{escape(outcome_words(record))}</tspan></text>'
        f'<text class="quiet" y="{map_px + 35}">{escape(why)}</text></g>'
    )
