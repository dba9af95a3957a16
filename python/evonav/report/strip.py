"""A task as a strip, for a README or a paper: stages side by side, agents below each other."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from evonav.errors import InvalidArgumentError, StoreError
from evonav.evaluation.records import EndState, StageMap, StageRecord
from evonav.evaluation.store import RunStore
from evonav.report.causes import Cause, sentence
from evonav.report.legend import legend_row
from evonav.report.maps import (
    change_words,
    file_css,
    outcome_words,
    stage_drawing,
    success_radius_of,
    task_frame,
)
from evonav.report.plan import Frame
from evonav.report.run import Run, load_run
from evonav.report.svg import escape, join, text_lines

PANEL_PX = 360
GAP_PX = 18
HEAD_PX = 112
FOOT_PX = 50
IMAGE_PX = 78


def write_strip(
    run_dir: Path, task_id: str | None, agents: str | Sequence[str], path: Path, *, stages: Sequence[int] | None = None
) -> Path:
    """Writes a task as a strip.

    Args:
        run_dir: A run.
        task_id: One of its tasks; `None` for the `most_telling` one.
        agents: One of its agents, or several: a row each.
        path: The SVG file to write.
        stages: Which stages; default all that have a record (of the most telling task, three).

    Returns:
        `path`.

    Raises:
        InvalidArgumentError: The run has no such stage.
        StoreError: There is no run, it cannot be read, or the file cannot be written.
    """
    agents = [agents] if isinstance(agents, str) else list(agents)
    if task_id is None:
        task_id, telling = most_telling(load_run(run_dir), agents)
        stages = stages or telling
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
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(strip_svg(rows, maps, success_radius_m=success_radius_of(config)), encoding="utf-8")
    except OSError as error:
        raise StoreError(f"{path}: {error}") from error
    return path


def most_telling(run: Run, agents: Sequence[str], num_stages: int = 3) -> tuple[str, list[int]]:
    """The episode whose picture tells most about the benchmark, and the stages to show.

    Looks for a stage where one of the agents is misled by a stale entry and another is not, or is misled and recovers;
    then for moved targets, and for change and success on the way there. The first of equals.

    Args:
        run: A run.
        agents: Whose episodes to show; the last one should succeed.
        num_stages: How many stages to show, ending with the telling one.

    Raises:
        InvalidArgumentError: None of the run's tasks has a record of every one of the agents.
    """
    best: tuple[float, str, list[int]] | None = None
    for task_id, last_stage in run.num_stages.items():
        for stage in range(1, last_stage + 1):
            shown = list(range(max(1, stage - num_stages + 1), stage + 1))
            keys = [(agent, task_id, k) for agent in agents for k in shown]
            if any(key not in run.outcomes for key in keys):
                continue
            score = _telling(run, agents, task_id, shown)
            if best is None or score > best[0]:
                best = (score, task_id, shown)
    if best is None:
        raise InvalidArgumentError(f"{run.run_dir}: no task has records of {', '.join(agents)}")
    return best[1], best[2]


def _telling(run: Run, agents: Sequence[str], task_id: str, stages: Sequence[int]) -> float:
    last = [run.outcomes[agent, task_id, stages[-1]] for agent in agents]
    hero = last[-1]
    has_success = hero.record.state is EndState.SUCCESS
    is_misled = any(outcome.cause is Cause.STALE_ENTRY for outcome in last)
    score = 6.0 * (is_misled and has_success) + 4.0 * (hero.stale_path_m > 0 and has_success)
    score += 2.0 * hero.record.target.is_relocated_now + 2.0 * has_success + len(stages)
    window = [run.outcomes[agents[-1], task_id, k].record for k in stages]
    score += sum(record.transition.kind != "static" for record in window)
    return score + sum(record.state is EndState.SUCCESS for record in window)


def strip_svg(rows: Sequence[Sequence[StageRecord]], maps: Mapping[int, StageMap], *, success_radius_m: float) -> str:
    """The strip: a row an agent, a column a stage."""
    everything = [record for row in rows for record in row]
    frame = task_frame(maps, everything)
    map_px = round(PANEL_PX * frame.height / frame.width)
    told = {record.stage: record for record in reversed(everything)}
    left_px = {stage: GAP_PX + i * (PANEL_PX + GAP_PX) for i, stage in enumerate(sorted(told))}
    width_px = GAP_PX + len(told) * (PANEL_PX + GAP_PX)
    heads = join(_head(record, maps, left_px[stage]) for stage, record in sorted(told.items()))
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


def _head(record: StageRecord, maps: Mapping[int, StageMap], left_px: int) -> str:
    """What was asked in a stage, what the agents were shown, and what had changed."""
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
    maps: Mapping[int, StageMap],
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
