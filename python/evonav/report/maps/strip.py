"""Draw a task as a strip, for a README or a paper: stages side by side, agents below each other."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from evonav.drawing.files import check_picture, write_picture
from evonav.drawing.svg import escape, join, text_lines
from evonav.errors import InvalidArgumentError
from evonav.evaluation.records.floor_plans import FloorPlan
from evonav.evaluation.records.schema import EndState, StageRecord
from evonav.evaluation.records.store import RunStore
from evonav.report.maps.sheet import instruction_lines, panel, panel_height_px, reference_image, sheet
from evonav.report.maps.stage_map import stage_drawing, success_radius_of, task_frame
from evonav.report.maps.text import describe_change
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
        task_id: One of its tasks; `None` for the `best_highlight` one.
        agents: One of its agents, or several: a row each.
        stages: Numbers of stages; default all that have a record (of the most telling task, three).

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
        maps = {floor_plan.stage: floor_plan for floor_plan in store.floor_plans(task_id)}
        config = store.meta("config") or {}
    for agent, row in zip(agents, rows, strict=True):
        if not row:
            raise InvalidArgumentError(f"{run_dir}: no such stage of task {task_id!r} by agent {agent!r}")
    return write_picture(strip_svg(rows, maps, success_radius_m=success_radius_of(config)), path)


def strip_svg(rows: Sequence[Sequence[StageRecord]], maps: Mapping[int, FloorPlan], *, success_radius_m: float) -> str:
    """Return the strip: a row an agent, a column a stage."""
    everything = [record for row in rows for record in row]
    frame = task_frame(maps, everything)
    row_px = panel_height_px(frame, PANEL_PX) + FOOT_PX
    shown = {record.stage: record for record in reversed(everything)}
    left_px = {stage: GAP_PX + i * (PANEL_PX + GAP_PX) for i, stage in enumerate(sorted(shown))}
    width_px = GAP_PX + len(shown) * (PANEL_PX + GAP_PX)
    heads = join(_head(record, maps, left_px[stage]) for stage, record in sorted(shown.items()))
    panels = join(
        panel(
            record,
            stage_drawing(record, maps, frame, success_radius_m, has_item_names=False),
            frame,
            (left_px[record.stage], HEAD_PX + i * row_px),
            PANEL_PX,
            (record.agent, {EndState.SUCCESS: "ok", EndState.FAILURE: "bad"}.get(record.state, "quiet")),
            [("quiet", 35, text_lines(sentence(record), 60, 1)[0])],
        )
        for i, row in enumerate(rows)
        for record in row
    )
    agents = ", ".join(dict.fromkeys(record.agent for record in everything))
    top_px = HEAD_PX + len(rows) * row_px + 10
    return sheet(f"{everything[0].task_id}: {agents}", heads + panels, width_px, top_px, GAP_PX, foot_px=8)


def _head(record: StageRecord, maps: Mapping[int, FloorPlan], left_px: int) -> str:
    """Draw the goal of a stage, its reference image, and what had changed."""
    image = reference_image(maps.get(record.stage), PANEL_PX, 10, IMAGE_PX)
    lines = instruction_lines(record.goal.instruction, 38 if image else 54, 3)
    changed = text_lines(describe_change(record, maps), 56, 1)[0]
    css = "quiet" if record.transition.kind == "static" else "change-words"
    return (
        f'<g transform="translate({left_px} 0)"><text class="stage" y="27">Stage {record.stage}</text>{lines}{image}'
        f'<text class="{css}" y="{HEAD_PX - 7}">{escape(changed)}</text></g>'
    )
