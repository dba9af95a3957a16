"""Draw the map of a stage, and say in words what happened before it and how it ended."""

from collections.abc import Mapping, Sequence

from evonav.counted import counted
from evonav.drawing.floor_plan import Frame, frame_of, ground, item_labels, labels
from evonav.drawing.style import file_css
from evonav.drawing.svg import escape, slug
from evonav.evaluation.metrics.navigation import Stage
from evonav.evaluation.metrics.scoring import SUCCESS_RADIUS_M
from evonav.evaluation.records.schema import EndState, FloorPlan, StageRecord
from evonav.report.maps.trajectory import change, course
from evonav.report.tables.causes import sentence
from evonav.report.tables.table import mode_words
from evonav.tasks.language import noun_of

STAGE_WIDTH_PX = 900
VIEW_DIR = "view"
"""Folder of a run with the pages of `evonav view`."""


def stage_svg(
    record: StageRecord,
    maps: Mapping[int, FloorPlan],
    *,
    success_radius_m: float = SUCCESS_RADIUS_M,
) -> str:
    """Return one stage as an SVG document; a stage without a map is drawn without its house."""
    frame = task_frame(maps, [record])
    height_px = round(STAGE_WIDTH_PX * frame.height / frame.width)
    drawing = stage_drawing(record, maps, frame, success_radius_m, has_item_names=True)
    name = f"{record.task_id}, stage {record.stage}, {record.agent}"
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" class="map" viewBox="{frame.view_box}" '
        f'width="{STAGE_WIDTH_PX}" height="{height_px}" role="img"><title>{escape(name)}</title>'
        f"<desc>{escape(record.goal.instruction)} {escape(sentence(record))}</desc><style>{file_css()}</style>"
        f"{drawing}</svg>\n"
    )


def map_name(record: StageRecord) -> str:
    """Return the file name of a stage's map."""
    return f"{slug(record.task_id)}_{slug(record.agent)}_stage{record.stage}.svg"


def page_name(task_id: str, agent: str, stage: int | None = None) -> str:
    """Return the file name of a viewer's page of an episode, or of one stage of it."""
    return f"{slug(task_id)}_{slug(agent)}{'' if stage is None else f'_stage{stage}'}.html"


def change_words(record: StageRecord, maps: Mapping[int, FloorPlan]) -> str:
    """Describe what happened before the stage in a few words."""
    transition = record.transition
    if transition.kind == "static":
        return "first stage" if record.stage == 1 else "nothing changed"
    rooms = {room.room_id: noun_of(room.room_type) for m in maps.values() for room in m.rooms}
    room = rooms.get(transition.room_id or "", transition.room_id or "a room")
    moved = f"{counted(len(transition.relocations), 'object')} moved"
    phrases = [f"{mode_words(transition.mode)} in the {room}: {moved}"] if transition.mode is not None else []
    if transition.kind == "activities":
        phrases.append(f"daily activities, most in the {room}: {moved}")
    counts = {"came": transition.num_added, "went": transition.num_removed, "opened or switched": transition.num_states}
    phrases.extend(f"{counted(number, 'object')} {what}" for what, number in counts.items() if number)
    return ", ".join(phrases)


def outcome_words(stage: Stage) -> str:
    """Return `success, SPL 0.83` and the like."""
    if stage.state == EndState.SUCCESS:
        return "success" if stage.spl is None else f"success, SPL {stage.spl:.2f}"
    return EndState(stage.state).value.replace("_", " ")


def task_frame(maps: Mapping[int, FloorPlan], records: Sequence[StageRecord]) -> Frame:
    """Return the frame that a task's pictures share: the house, or the path where no house was recorded."""
    if any(floor_plan.rooms or floor_plan.walls for floor_plan in maps.values()):
        return frame_of(maps.values())
    points = [point for record in records for entry in record.trace for point in entry.path_m]
    points += [(record.target.position_m[0], record.target.position_m[2]) for record in records]
    return Frame.around(points)


def success_radius_of(config: Mapping[str, object]) -> float:
    """Return the success radius of a run from its header."""
    protocol = config.get("protocol")
    radius_m = protocol.get("success_radius_m") if isinstance(protocol, dict) else None
    return float(radius_m) if isinstance(radius_m, int | float) else SUCCESS_RADIUS_M


def stage_drawing(
    record: StageRecord, maps: Mapping[int, FloorPlan], frame: Frame, success_radius_m: float, *, has_item_names: bool
) -> str:
    """Return a stage's house and what happened in it, as the content of an `svg` element."""
    floor_plan = maps.get(record.stage)
    names = item_labels(floor_plan.objects, frame) if has_item_names and floor_plan is not None else ""
    return house_drawing(record, maps, frame, names) + course(record, frame, success_radius_m)


def house_drawing(
    record: StageRecord, maps: Mapping[int, FloorPlan], frame: Frame, item_names: str = "", *, on_it: str = ""
) -> str:
    """Return the house of a stage, with what moved before it, `on_it`, and the names of its rooms on top."""
    floor_plan, changed = maps.get(record.stage), change(record, maps, frame)
    if floor_plan is None:
        return changed + on_it
    return ground(floor_plan, frame) + changed + item_names + on_it + labels(floor_plan, frame)
