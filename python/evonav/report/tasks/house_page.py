"""Write the page of one house."""

from collections.abc import Sequence

from markupsafe import Markup

from evonav.report.pages.template import page_text, text_of


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
