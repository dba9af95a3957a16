"""Draws the picture of the README: `python scripts/docs/draw_episode.py RUN TASK AGENT,AGENT STAGE,STAGE FILE`."""

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from evonav.drawing.files import write_picture
from evonav.drawing.svg import escape, join, text_lines
from evonav.evaluation.records.floor_plans import FloorPlan
from evonav.evaluation.records.schema import EndState, StageRecord
from evonav.evaluation.records.store import RunStore
from evonav.report.maps.stage_map import (
    instruction_lines,
    panel,
    panel_height_px,
    reference_image,
    sheet,
    stage_drawing,
    success_radius_of,
    task_frame,
)
from evonav.report.maps.text import describe_change
from evonav.report.tables.causes import sentence

PANEL_PX = 360
GAP_PX = 18
HEAD_PX = 112
FOOT_PX = 50
IMAGE_PX = 78


def main() -> None:
    """Draws stages of a task, the agents of a run below each other."""
    run_dir, task_id, agents, stages, path = sys.argv[1:]
    with RunStore(Path(run_dir)) as store:
        shown = [int(stage) for stage in stages.split(",")]
        rows = [
            [record for record in store.records(agent, task_id) if record.stage in shown] for agent in agents.split(",")
        ]
        maps = {floor_plan.stage: floor_plan for floor_plan in store.floor_plans(task_id)}
        radius_m = success_radius_of(store.meta("config") or {})
    write_picture(strip_svg(rows, maps, success_radius_m=radius_m), Path(path))


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


if __name__ == "__main__":
    main()
