"""Write pages of houses and tasks, which show the oracle: every stage before and after its change, and a gallery."""

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup

from evonav.counted import counted
from evonav.drawing.files import check_picture, write_picture
from evonav.drawing.floor_plan import Frame
from evonav.drawing.style import map_css, map_file
from evonav.drawing.svg import escape, join, slug
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
from evonav.report.tasks.text import change_sentence, move_rows, stage_facts
from evonav.tasks import Task

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


def _plans(drawing: TaskDrawing, stage: int) -> list[tuple[str, Frame, str]]:
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
