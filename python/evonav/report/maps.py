"""Maps as SVG files: one of a stage, and a strip of a task's stages side by side."""

import re
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path

from evonav.errors import InvalidArgumentError
from evonav.evaluation.metrics import SUCCESS_RADIUS_M
from evonav.evaluation.records import EndState, StageMap, StageRecord
from evonav.evaluation.store import RunStore
from evonav.report.causes import sentence
from evonav.report.overlay import change, course
from evonav.report.plan import Frame, frame_of, ground, item_labels, labels
from evonav.report.svg import escape, join, slug, text_lines
from evonav.tasks.language import noun_of

STAGE_WIDTH_PX = 900
STRIP_PANEL_PX = 360
STRIP_GAP_PX = 16
STRIP_HEAD_PX = 104
STRIP_FOOT_PX = 66


def map_css() -> str:
    """Colours and fonts of maps on a page: custom properties, light and dark."""
    return str((files("evonav.report") / "templates" / "map.css").read_text(encoding="utf-8"))


def file_css() -> str:
    """The same for a file of its own: colours written out, since few programs but browsers know custom properties."""
    light, dark, rules = map_css().split("/* --- */")
    return f"{_inlined(rules, light)}@media (prefers-color-scheme:dark){{{_inlined(rules, dark)}}}"


def _inlined(rules: str, properties: str) -> str:
    """Rules with every `var(--name)` replaced by its value."""
    values = dict(re.findall(r"--(\w+):(#\w+)", properties))
    return re.sub(r"var\(--(\w+)\)", lambda match: values[match[1]], rules)


def stage_svg(
    record: StageRecord,
    maps: Mapping[int, StageMap],
    *,
    success_radius_m: float = SUCCESS_RADIUS_M,
) -> str:
    """A file of its own with one stage.

    Args:
        record: The stage.
        maps: The task's maps by stage; a stage without one is drawn without its house.
        success_radius_m: Of the ring around the target.
    """
    frame = task_frame(maps, [record])
    height_px = round(STAGE_WIDTH_PX * frame.height / frame.width)
    name = f"{record.task_id}, stage {record.stage}, {record.agent}"
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" class="map" viewBox="{frame.view_box}" '
        f'width="{STAGE_WIDTH_PX}" height="{height_px}" role="img"><title>{escape(name)}</title>'
        f"<desc>{escape(record.goal.instruction)} {escape(sentence(record))}</desc><style>{file_css()}</style>"
        f"{_stage(record, maps, frame, success_radius_m)}</svg>\n"
    )


def map_name(record: StageRecord) -> str:
    """File name of a stage's map."""
    return f"{slug(record.task_id)}_{slug(record.agent)}_stage{record.stage}.svg"


def write_strip(run_dir: Path, task_id: str, agent: str, path: Path, *, stages: Sequence[int] | None = None) -> Path:
    """Writes one episode as a strip: its stages side by side, the same house as it changes.

    Args:
        run_dir: A run.
        task_id: One of its tasks.
        agent: One of its agents.
        path: The SVG file to write.
        stages: Which stages; default all that have a record.

    Returns:
        `path`.

    Raises:
        InvalidArgumentError: The run has no such stage.
        StoreError: There is no run, or it cannot be read.
    """
    with RunStore(run_dir) as store:
        records = [r for r in store.records(agent, task_id) if stages is None or r.stage in stages]
        maps = {stage_map.stage: stage_map for stage_map in store.maps(task_id)}
        config = store.meta("config") or {}
    if not records:
        raise InvalidArgumentError(f"{run_dir}: no such stage of task {task_id!r} by agent {agent!r}")
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(strip_svg(records, maps, success_radius_m=success_radius_of(config)), encoding="utf-8")
    return path


def strip_svg(records: Sequence[StageRecord], maps: Mapping[int, StageMap], *, success_radius_m: float) -> str:
    """Stages of one episode side by side, with what was asked, what changed and how it ended."""
    frame = task_frame(maps, records)
    map_px = STRIP_PANEL_PX * frame.height / frame.width
    total_px = (len(records) * (STRIP_PANEL_PX + STRIP_GAP_PX) + STRIP_GAP_PX, STRIP_HEAD_PX + map_px + STRIP_FOOT_PX)
    panels = join(
        _panel(record, maps, frame, map_px, success_radius_m, STRIP_GAP_PX + i * (STRIP_PANEL_PX + STRIP_GAP_PX))
        for i, record in enumerate(records)
    )
    name = f"{records[0].agent} on {records[0].task_id}: {len(records)} stages"
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" class="map strip" viewBox="0 0 {total_px[0]} {total_px[1]:.0f}" '
        f'width="{total_px[0]}" height="{total_px[1]:.0f}" role="img"><title>{escape(name)}</title>'
        f'<style>{file_css()}</style><rect class="page" width="100%" height="100%" rx="10"/>{panels}</svg>\n'
    )


def change_words(record: StageRecord, maps: Mapping[int, StageMap]) -> str:
    """What happened before the stage, in a few words."""
    transition = record.transition
    if record.stage == 1:
        return "first stage"
    if transition.mode is None:
        return "nothing changed"
    rooms = {room.room_id: noun_of(room.room_type) for m in maps.values() for room in m.rooms}
    room = rooms.get(transition.room_id or "", transition.room_id or "a room")
    num = len(transition.relocations)
    return f"{transition.mode} in the {room}: {num} object{'' if num == 1 else 's'} moved"


def outcome_words(record: StageRecord) -> str:
    """`success, SPL 0.83` and the like."""
    if record.state is EndState.SUCCESS:
        return "success" if record.spl is None else f"success, SPL {record.spl:.2f}"
    return str(record.state.value).replace("_", " ")


def task_frame(maps: Mapping[int, StageMap], records: Sequence[StageRecord]) -> Frame:
    """The frame that a task's pictures share: the house, or the path where no house was recorded."""
    if any(stage_map.rooms or stage_map.walls for stage_map in maps.values()):
        return frame_of(maps.values())
    points = [point for record in records for entry in record.trace for point in entry.path_m]
    points += [(record.target.position_m[0], record.target.position_m[2]) for record in records]
    return Frame.around(points)


def success_radius_of(config: Mapping[str, object]) -> float:
    """The run's success radius, from its header."""
    protocol = config.get("protocol")
    radius_m = protocol.get("success_radius_m") if isinstance(protocol, dict) else None
    return float(radius_m) if isinstance(radius_m, int | float) else SUCCESS_RADIUS_M


def _stage(record: StageRecord, maps: Mapping[int, StageMap], frame: Frame, success_radius_m: float) -> str:
    stage_map = maps.get(record.stage)
    changed = change(record.transition, frame, stage_map=stage_map, previous_map=maps.get(record.stage - 1))
    below, names = changed, ""
    if stage_map is not None:
        below = ground(stage_map, frame) + changed
        names = item_labels(stage_map.objects, frame) + labels(stage_map, frame)
    return below + names + course(record, frame, success_radius_m)


def _panel(
    record: StageRecord,
    maps: Mapping[int, StageMap],
    frame: Frame,
    map_px: float,
    success_radius_m: float,
    left_px: int,
) -> str:
    instruction = text_lines(record.goal.instruction, 52, 2)
    lines = join(
        f'<text class="instruction" x="0" y="{47 + 17 * i}">{escape(line)}</text>' for i, line in enumerate(instruction)
    )
    changed = text_lines(change_words(record, maps), 56, 1)[0]
    css = "change-words" if record.transition.mode else "quiet"
    verdict = {EndState.SUCCESS: "ok", EndState.FAILURE: "bad"}.get(record.state, "quiet")
    end = join(
        f'<text class="quiet" x="0" y="{STRIP_HEAD_PX + map_px + 42 + 15 * i:.0f}">{escape(line)}</text>'
        for i, line in enumerate(text_lines(sentence(record), 60, 1))
    )
    return (
        f'<g transform="translate({left_px} 0)"><text class="stage" x="0" y="27">Stage {record.stage}</text>{lines}'
        f'<text class="{css}" x="0" y="{47 + 17 * 2 + 4}">{escape(changed)}</text>'
        f'<svg x="0" y="{STRIP_HEAD_PX}" width="{STRIP_PANEL_PX}" height="{map_px:.0f}" viewBox="{frame.view_box}">'
        f"{_stage(record, maps, frame, success_radius_m)}</svg>"
        f'<text class="verdict {verdict}" x="0" y="{STRIP_HEAD_PX + map_px + 22:.0f}">'
        f"{escape(outcome_words(record))}</text>{end}</g>"
    )
