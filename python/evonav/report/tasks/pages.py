"""Write pages of houses and tasks, which show the oracle: every stage before and after its change, and a gallery."""

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup

from evonav.counted import counted
from evonav.drawing.files import check_picture, write_picture
from evonav.drawing.floor_plan import PlanFrame
from evonav.drawing.style import map_css, map_file
from evonav.drawing.svg import escape, join, slug
from evonav.evaluation.records.floor_plans import FloorPlan
from evonav.parallel.folders import write_atomically
from evonav.report.maps.legend import TASK_ENTRIES, legend
from evonav.report.pages.template import page_text, text_of
from evonav.report.tables.table import mode_words
from evonav.report.tasks.floor_plans import (
    TaskDrawing,
    after_svg,
    before_svg,
    change_frame,
    course_svg,
    definitions,
    task_drawing,
    thumbnail_svg,
)
from evonav.tasks import Task
from evonav.tasks.language import noun_of
from evonav.tasks.oracle import Evolution, OracleStage

INDEX_NAME = "index.html"
PLAN_HEIGHT_PX = 700
CAPTION_PX = 40


def write_task_page(task: Task, path: Path, *, stages: Sequence[int] | None = None) -> Path:
    """Write all of a task's stages, or only some, as one HTML file that needs no other; return its path."""
    return write_atomically(path, _task_page(task_drawing(task), stages or range(1, task.num_stages + 1)))


def write_stage_picture(task: Task, stage: int, path: Path) -> Path:
    """Write a stage as a `.svg`, `.png` or `.pdf` file: the house before (if it changed) and after, side by side.

    Raises:
        HouseError: A stage house is malformed.
        InvalidArgumentError: The file's suffix is of no format.
        StoreError: The file cannot be written, or not without an extra.
    """
    check_picture(path)
    return write_picture(stage_svg(task_drawing(task), stage), path)


def write_gallery(
    tasks: Iterable[Task], out_dir: Path, name: str, *, on_task: Callable[[str], None] | None = None
) -> Path:
    """Write a page for each task, and `index.html` with a card for each.

    Args:
        out_dir: Folder of the pages; the path of the index is returned.
        on_task: Called with each task's id when its page is written.
    """
    cards = []
    for i, task in enumerate(tasks):
        drawing = task_drawing(task, f"p{i}")
        page = f"{slug(task.task_id)}.html"
        write_atomically(out_dir / page, _task_page(drawing, range(1, task.num_stages + 1), INDEX_NAME))
        cards.append(_card(drawing, page))
        if on_task is not None:
            on_task(task.task_id)
    num_stages = sum(card["num_stages"] for card in cards)
    index = page_text(
        "tasks.html.j2",
        _css(),
        text_of("tasks.js"),
        has_drawings=True,
        name=name,
        summary=f"{counted(len(cards), 'task')}, {counted(num_stages, 'stage')}",
        cards=cards,
        mode_words={mode: mode_words(mode) for card in cards for mode in card["modes"]},
        modes=sorted({mode for card in cards for mode in card["modes"]}),
        rooms=sorted({card["num_rooms"] for card in cards}),
    )
    return write_atomically(out_dir / INDEX_NAME, index)


def house_page(
    name: str, *, summary: str, task: str, rooms: Sequence[Sequence[str]], findings: Sequence[str], plan_svg: str | None
) -> str:
    """Return a page in one file.

    Args:
        task: Whether it gives a task, and why not.
        rooms: Id, type, floor area and number of objects of each room.
        findings: Its flaws, wrong or odd.
        plan_svg: Its plan, drawn by evonav; `None` for a house that cannot be read.
    """
    return page_text(
        "house.html.j2",
        text_of("report.css"),
        has_drawings=True,
        name=name,
        summary=summary,
        task=task,
        rooms=rooms,
        findings=findings,
        plan=None if plan_svg is None else Markup(plan_svg),  # noqa: S704 - our own drawing
    )


def stage_svg(drawing: TaskDrawing, stage: int) -> str:
    """Draw a stage as an SVG document: its plans side by side."""
    panels, left_px = [], 0
    for caption, frame, content in _plans(drawing, stage):
        width_px = round(PLAN_HEIGHT_PX * min(1.6, frame.width / frame.height))
        panels.append(
            f'<text class="stage" x="{left_px + 12}" y="28">{escape(caption)}</text>'
            f'<svg x="{left_px}" y="{CAPTION_PX}" width="{width_px}" height="{PLAN_HEIGHT_PX}" '
            f'viewBox="{frame.view_box}">{content}</svg>'
        )
        left_px += width_px
    name = f"{drawing.task.task_id}, stage {stage}"
    changed = change_sentence(drawing.maps[stage], drawing.task.oracle(stage).evolution)
    page = f'<defs>{definitions(drawing)}</defs><rect class="page" width="100%" height="100%"/>{join(panels)}'
    return map_file(name, (left_px, CAPTION_PX + PLAN_HEIGHT_PX), page, description=changed)


def _task_page(drawing: TaskDrawing, stages: Iterable[int], index: str | None = None) -> str:
    """Return a page; `index` is the address of the gallery that links to it."""
    return page_text(
        "stages.html.j2",
        _css(),
        has_drawings=True,
        header=drawing.task.header,
        index=index,
        legend=legend(TASK_ENTRIES),
        defs=Markup(definitions(drawing)),  # noqa: S704 - our own SVG
        stages=[_stage_values(drawing, stage) for stage in stages],
    )


def _stage_values(drawing: TaskDrawing, stage: int) -> dict[str, object]:
    """Return a stage as the template shows it; `plans` are caption, view box and content."""
    task, floor_plan = drawing.task, drawing.maps[stage]
    public, oracle = task.public_stages[stage - 1], task.oracle(stage)
    plans = _plans(drawing, stage)
    return {
        "number": stage,
        "has_changed": len(plans) > 1,
        "changed": change_sentence(floor_plan, oracle.evolution),
        "plans": [(caption, frame.view_box, Markup(svg)) for caption, frame, svg in plans],  # noqa: S704 - our own SVG
        "image": floor_plan.reference_image or "",
        "instructions": [
            ("basic instruction", public.basic_instruction),
            ("appearance instruction", public.appearance_instruction),
            ("unified instruction", public.unified_instruction),
        ],
        "facts": stage_facts(floor_plan, oracle),
        "moves": move_rows(floor_plan, oracle.evolution),
    }


def _plans(drawing: TaskDrawing, stage: int) -> list[tuple[str, PlanFrame, str]]:
    """Return caption, frame and content of a stage's plans: where it changed, before and after, and the whole."""
    evolution = drawing.task.oracle(stage).evolution
    plans = []
    if stage > 1 and any((evolution.changes, evolution.additions, evolution.removals, evolution.states)):
        frame = change_frame(drawing, stage)
        plans.append((f"before (stage {stage - 1})", frame, before_svg(drawing, stage, frame)))
        plans.append((f"after (stage {stage})", frame, after_svg(drawing, stage, frame)))
    return [*plans, ("the house, and the reference path", drawing.frame, course_svg(drawing, stage))]


def _card(drawing: TaskDrawing, href: str) -> dict[str, Any]:
    """Return a task as the gallery shows it."""
    task = drawing.task
    evolutions = [stage.evolution for stage in task.oracle_stages]
    most = max(range(1, task.num_stages + 1), key=lambda k: (len(evolutions[k - 1].changes), -k))
    searched = [task.task_id, task.header.house.name, *(stage.category for stage in task.public_stages)]
    return {
        "href": href,
        "task_id": task.task_id,
        "num_rooms": task.header.house.num_rooms,
        "num_stages": task.num_stages,
        "modes": sorted({one.mode for one in evolutions if one.outcome == "evolved" and one.mode}),
        "search_text": " ".join(searched).lower(),
        "view_box": drawing.frame.view_box,
        "svg": Markup(thumbnail_svg(drawing, most)),  # noqa: S704 - our own SVG
    }


def _css() -> Markup:
    return text_of("report.css") + text_of("tasks.css") + map_css()


OUTCOMES = {
    "first_stage": "The first stage: the house as in its file.",
    "not_triggered": "Nothing changed before this stage.",
    "no_room": "A change was drawn, but no room could take one.",
    "no_placement": "A change was drawn, but nothing could be moved",
    "evolved": "",
}
FAILURES = {
    "nothing_movable": "the room holds nothing that moves",
    "no_free_place": "no free place was found",
    "cuts_off": "every free place would have cut something off",
}


def stage_facts(floor_plan: FloorPlan, oracle: OracleStage) -> list[tuple[str, str]]:
    """Name and value of what a stage's page lists."""
    nouns = {item.object_id: noun_of(item.category) for item in floor_plan.objects}
    rooms = room_namer(floor_plan)
    target, evolution = oracle.target, oracle.evolution
    others = f", {len(target.same_category_ids)} more of its kind" if target.same_category_ids else ", the only one"
    where = f" on the {nouns.get(target.support_id, target.support_id)}" if target.support_id else ""
    moved = (
        "moved just now" if target.is_relocated_now else "moved earlier" if target.is_relocated_ever else "never moved"
    )
    facts = [
        ("target", f"{noun_of(target.category)} {target.id}{where}, {rooms(target.room_id)}{others}; {moved}"),
        ("reference", f"{oracle.reference_path_length_m:.1f} m, {oracle.reference_visible_px} px of the target seen"),
    ]
    if oracle.state.transition_room_id is not None:
        facts.append(("transition room", rooms(oracle.state.transition_room_id)))
    if oracle.rejections:
        refused = [f"{nouns.get(item.id, item.id)} ({item.reason.replace('_', ' ')})" for item in oracle.rejections]
        facts.append(("goals refused", ", ".join(refused)))
    if oracle.during is not None:
        where = "the target moves" if oracle.during.is_target_relocated else "the target stays"
        sentence = change_sentence(floor_plan, oracle.during.evolution)
        facts.append((f"during the stage, round {oracle.during.round}", f"{sentence} {where.capitalize()}."))
    lists = {
        "found no place": evolution.unmoved_ids,
        "would have cut something off": evolution.blocking_ids,
        "stand closer than usual": evolution.crowded_ids,
        "rearranged": evolution.rearranged_ids,
    }
    for name, ids in lists.items():
        if ids:
            facts.append((name, ", ".join(f"{nouns.get(i, '')} {i}".strip() for i in ids)))
    if evolution.room_weights:
        weights = (f"{rooms(weight.room_id)} {weight.weight:g}" for weight in evolution.room_weights)
        facts.append(("rooms' weights", ", ".join(weights)))
    return facts


def change_sentence(floor_plan: FloorPlan, evolution: Evolution) -> str:
    """Describe what changed before a stage, in one sentence."""
    text = OUTCOMES[evolution.outcome]
    if evolution.outcome == "no_placement":
        text += f": {FAILURES[evolution.failure]}." if evolution.failure else "."
    if evolution.outcome == "evolved" and evolution.mode is not None:
        room = room_namer(floor_plan)(evolution.room_id or "")
        moved = f"{counted(len(evolution.changes), 'object')} moved"
        if evolution.changes:
            farthest = max(evolution.changes, key=lambda change: (change.displacement_m, change.id))
            moved += f", farthest the {noun_of(farthest.category)}, by {farthest.displacement_m:.1f} m"
        text = f"{mode_words(evolution.mode).capitalize()} in the {room}: {moved}."
    extra = [
        (len(evolution.additions), "came"),
        (len(evolution.removals), "went"),
        (len(evolution.states), "opened, closed or switched"),
    ]
    more = ", ".join(f"{num} {what}" for num, what in extra if num)
    return f"{text} By extensions: {more}.".strip() if more else text


def move_rows(floor_plan: FloorPlan, evolution: Evolution) -> list[tuple[str, ...]]:
    """List moved objects, the farthest first: object, id, distance, turn, old and new support, cause."""
    nouns = {item.object_id: noun_of(item.category) for item in floor_plan.objects}
    rows: list[tuple[str, ...]] = []
    for change in sorted(evolution.changes, key=lambda change: (-change.displacement_m, change.id)):
        turn_deg = (change.to_rotation_deg[1] - change.from_rotation_deg[1]) % 360.0
        supports = (change.from_support_id, change.to_support_id)
        stood, stands = (nouns.get(support, support) if support else "floor" for support in supports)
        on = stood if supports[0] == supports[1] else f"{stood} to {stands}"
        turn = f"{turn_deg:.0f}°"
        noun = noun_of(change.category)
        rows.append((noun, change.id, f"{change.displacement_m:.2f} m", turn, on, change.cause or ""))
    for what, records in (("came", evolution.additions), ("went", evolution.removals)):
        for record in records:
            support = nouns.get(record.support_id or "", "floor")
            rows.append((noun_of(record.category), record.id, what, "", support, record.cause))
    rows += [
        (noun_of(s.category), s.id, f"{s.field} {s.before:g} to {s.after:g}", "", "", s.cause) for s in evolution.states
    ]
    return rows


def room_namer(floor_plan: FloorPlan) -> Callable[[str], str]:
    """Return a function that names rooms: their type, with the room's number where several are of that type."""
    types = Counter(room.room_type for room in floor_plan.rooms)
    names = {}
    for room in floor_plan.rooms:
        number = room.room_id.rsplit("|", 1)[-1]
        names[room.room_id] = noun_of(room.room_type) + (f" {number}" if types[room.room_type] > 1 else "")
    return lambda room_id: names.get(room_id, room_id)
