"""Draw the pictures of `evonav video`: what the agent saw, what it believed and what was true, side by side."""

from collections.abc import Iterator, Mapping, Sequence
from io import BytesIO

from PIL import Image

from evonav.counted import counted
from evonav.drawing.files import png_of
from evonav.drawing.floor_plan import PlanFrame
from evonav.drawing.style import light_css
from evonav.drawing.svg import escape, join, text_lines
from evonav.evaluation.records.floor_plans import FloorPlan
from evonav.evaluation.records.schema import EndState, RoundRecord
from evonav.replay.frame_maps import UNKNOWN_COLOUR, belief_layer, house_layer, truth_layer
from evonav.replay.page_data import describe_truth
from evonav.replay.types import ReplayedRound, ReplayedStage
from evonav.report.maps.moments import Moment, moments
from evonav.report.maps.stage_map import task_frame
from evonav.report.maps.text import describe_change, describe_choice, describe_outcome, describe_reason
from evonav.report.pages.template import text_of
from evonav.report.tables.causes import sentence

SIZE = (1280, 720)
MARGIN = 16
TOP = 122
VIEW_PX = 280
MAP_PX = 468
GAP_PX = 4
NUM_SIDES = 3
"""Largest number of side views in a row."""
LEFTS = (MARGIN, VIEW_PX + 2 * MARGIN, VIEW_PX + MAP_PX + 3 * MARGIN)
"""Left edges of the view, the belief and the truth."""
FOOT_TOP = TOP + MAP_PX
"""Upper edge of what stands below the maps."""
_TIMELINE_PX = 8
_LETTER = 0.56
"""Width of a letter on average, of its height."""


def stage_frames(
    stage: ReplayedStage, maps: Mapping[int, FloorPlan], frame: PlanFrame, *, budget: int, success_radius_m: float
) -> Iterator[Image.Image]:
    """Yield a picture a round, and one of how the stage ended; the agent had `budget` rounds.

    Raises:
        StoreError: resvg is not installed.
    """
    film = _StageFilm(stage, maps, frame, budget, success_radius_m)
    for index in range(len(stage.rounds)):
        yield film.round(index)
    yield film.end()


def episode_frame(stages: Sequence[ReplayedStage], maps: Mapping[int, FloorPlan]) -> PlanFrame:
    """Return the frame of a task's maps."""
    return task_frame(maps, [stage.record for stage in stages])


class _StageFilm:
    """Draw what all pictures of a stage share once, and each round over it."""

    def __init__(
        self, stage: ReplayedStage, maps: Mapping[int, FloorPlan], frame: PlanFrame, budget: int, radius_m: float
    ) -> None:
        self._style = f"<style>{light_css(text_of('film.css'))}</style>"
        self._stage, self._frame, self._budget = stage, frame, budget
        self._backgrounds: list[tuple[int, Image.Image]] = []
        """Backgrounds of all pictures, with the round from which each is used."""
        for moment in moments(stage.record, maps):
            house = self._panel(house_layer(moment.record, moment.maps, frame, radius_m), "#ffffff")
            background = self._drawn(_header(moment), SIZE, "#ffffff").convert("RGB")
            background.paste(house, (LEFTS[2], TOP))
            self._backgrounds.append((moment.first_round, background))

    def round(self, index: int) -> Image.Image:
        """Return the picture of one round."""
        return self._picture(index, _captions(self._stage, self._stage.rounds[index]))

    def end(self) -> Image.Image:
        """Return the last round again, with how the stage ended in place of what was chosen."""
        record = self._stage.record
        css = {EndState.SUCCESS: "success", EndState.FAILURE: "failure"}.get(record.state, "other-end")
        outcome = describe_outcome(record)
        box = f'x="{MARGIN}" y="30" width="{28 + _LETTER * 26 * len(outcome):.0f}" height="44" rx="10"'
        verdict = f'<rect class="{css}" {box}/>{_text("end-text", MARGIN + 14, 61, outcome)}'
        cause = _paragraph("cause", MARGIN, 100, sentence(record), 20, SIZE[0] - 2 * MARGIN, 1)
        return self._picture(len(self._stage.rounds) - 1, verdict + cause)

    def _picture(self, index: int, captions: str) -> Image.Image:
        """Return a round with captions below its maps; `index` is -1 where a stage has no round."""
        picture = next(one for first, one in reversed(self._backgrounds) if first <= max(0, index)).copy()
        if index >= 0:
            step = self._stage.rounds[index]
            _paste_views(picture, step)
            belief = belief_layer(self._stage, step, self._frame)
            beyond = "#ffffff" if step.map is None else UNKNOWN_COLOUR
            picture.paste(self._panel(belief, beyond), (LEFTS[1], TOP))
            truth = self._panel(truth_layer(self._stage, step, self._frame), None)
            picture.paste(truth, (LEFTS[2], TOP), truth)
            captions += _position(self._stage, index, self._budget) + _timeline(self._stage, index)
        picture.paste(self._drawn(captions, (SIZE[0], SIZE[1] - FOOT_TOP), "#ffffff"), (0, FOOT_TOP))
        return picture

    def _panel(self, content: str, background: str | None) -> Image.Image:
        return self._drawn(content, (MAP_PX, MAP_PX), background, self._frame.view_box)

    def _drawn(
        self, content: str, size: tuple[int, int], background: str | None, view_box: str | None = None
    ) -> Image.Image:
        width, height = size
        svg = (
            f'<svg xmlns="http://www.w3.org/2000/svg" class="map" viewBox="{view_box or f"0 0 {width} {height}"}" '
            f'width="{width}" height="{height}">{self._style}{content}</svg>'
        )
        return Image.open(BytesIO(png_of(svg, background=background, has_system_fonts=False)))


def _header(moment: Moment) -> str:
    """Return agent, task and goal, and the heads of the panels."""
    first_round, record, maps = moment
    agent = record.agent[-40:]
    task_left = MARGIN + _LETTER * 26 * len(agent) + 18
    changed = " changed" if record.transition.relocations else ""
    change = describe_change(record, maps) if first_round == 0 else f"now: {describe_change(record, maps)}"
    truth = change if changed else f"what is true: {change}"
    heads = ("what it sees", "what it knows: map and memory", truth)
    return (
        _text("agent-name", MARGIN, 36, agent)
        + _text("task", task_left, 35, _fitted(record.task_id, 16, SIZE[0] - MARGIN - task_left))
        + _text("goal-text", MARGIN, 69, _fitted(record.goal.instruction, 20, SIZE[0] - 2 * MARGIN))
        + f'<path class="head-line" d="M0 84h{SIZE[0]}"/>'
        + join(
            _text(f"panel-head{changed if left == LEFTS[2] else ''}", left, TOP - 9, _fitted(head, 15, MAP_PX))
            for left, head in zip(LEFTS, heads, strict=True)
        )
    )


def _position(stage: ReplayedStage, index: int, budget: int) -> str:
    """Return which round it is, and how much the agent remembers in it."""
    step, record = stage.rounds[index], stage.record
    where = f"stage {record.stage} of {record.num_stages} · round {index + 1} of {len(stage.rounds)}"
    if step.map is None:
        note = step.note or "this agent does not tell what it knows"
    else:
        num_stale = sum(entry.record.is_stale for entry in step.entries)
        note = f"{counted(len(step.entries), 'entry')}, {num_stale} stale (red; the evaluator's knowledge)"
    return _text("where", SIZE[0] - MARGIN, 18, f"{where} (budget {budget})") + _text(
        "panel-note", LEFTS[1] + 4, 16, _fitted(note, 13, MAP_PX)
    )


def _paste_views(picture: Image.Image, step: ReplayedRound) -> None:
    """Paste the heading view, and the others in two rows below it."""
    if not step.views:
        return
    *others, heading = step.views
    seen = _scaled(heading.jpeg, VIEW_PX, VIEW_PX)
    picture.paste(seen, (LEFTS[0] + (VIEW_PX - seen.width) // 2, TOP))
    num_columns = min(NUM_SIDES, max(2, len(others)))
    width = (VIEW_PX - (num_columns - 1) * GAP_PX) // num_columns
    for i, view in enumerate(others[: 2 * num_columns]):
        row, column = divmod(i, num_columns)
        top = TOP + seen.height + 6 + row * (width + GAP_PX)
        picture.paste(_scaled(view.jpeg, width, width), (LEFTS[0] + column * (width + GAP_PX), top))


def _scaled(jpeg: bytes, width: int, height: int) -> Image.Image:
    """Return an image as large as a box lets it be."""
    picture = Image.open(BytesIO(jpeg))
    scale = min(width / picture.width, height / picture.height)
    size = (max(1, round(scale * picture.width)), max(1, round(scale * picture.height)))
    return picture.resize(size, Image.Resampling.LANCZOS)


def _captions(stage: ReplayedStage, step: ReplayedRound) -> str:
    """Return what the round chose and why on the left, and what the evaluator knows of it on the right."""
    record = step.record
    choice = "error" if record is None else f"chosen: {describe_choice(record)}"
    why = f"why: {reason}" if (reason := _reason(record)) else ""
    if step.questions and step.questions[-1].outcome != "answered":
        last = step.questions[-1]
        why = f"the question “{last.kind}” has no valid answer ({last.outcome}): {last.answer}"
    known = describe_truth(stage.record, step)
    seen = "the target is in view" if record is not None and record.is_target_visible else ""
    left, width = LEFTS[2], MAP_PX
    return (
        _text("choice", MARGIN, 50, _fitted(choice, 22, left - 2 * MARGIN))
        + _paragraph("caption", MARGIN, 78, why, 17, left - 2 * MARGIN, 2)
        + _paragraph("caption evaluator", left, 50, f"evaluator: {known}" if known else "", 17, width, 2)
        + _text("caption seen", left, 100, seen)
    )


def _reason(record: RoundRecord | None) -> str:
    """Return the reason of a round in plain words; empty where the agent gives none."""
    if record is None:
        return ""
    reason = record.details.get("reason")
    if record.action.kind == "stop":
        reason = record.action.reason or reason
    return describe_reason(reason) if isinstance(reason, str) else ""


def _timeline(stage: ReplayedStage, index: int) -> str:
    """Return a line of all rounds: what those so far chose."""
    num, drawn = len(stage.rounds), []
    gap = 1 if num < 200 else 0
    for i, step in enumerate(stage.rounds):
        entry = None if step.record is None else step.record.chosen_entry
        css = "explores" if entry is None else "to-stale" if entry.is_stale else "to-entry"
        left, width = SIZE[0] * i / num, SIZE[0] / num - gap
        box = f'x="{left:.1f}" y="{SIZE[1] - FOOT_TOP - _TIMELINE_PX}" width="{width:.1f}" height="{_TIMELINE_PX}"'
        drawn.append(f'<rect class="round {css if i <= index else "later"}" {box}/>')
    during = stage.record.during
    if during is not None and during.at_round is not None and during.at_round <= index:
        box = f'y="{SIZE[1] - FOOT_TOP - 2 * _TIMELINE_PX}" width="4" height="{2 * _TIMELINE_PX}"'
        drawn.append(f'<rect class="changes" x="{SIZE[0] * during.at_round / num - 2:.1f}" {box}/>')
    return join(drawn)


def _paragraph(css: str, left: float, top: float, text: str, size_px: int, width_px: float, max_lines: int) -> str:
    """Return lines of text that fit a width."""
    lines = text_lines(text, int(width_px / (_LETTER * size_px)), max_lines)
    spacing = round(1.3 * size_px)
    return join(_text(css, left, top + spacing * i, line) for i, line in enumerate(lines))


def _fitted(text: str, size_px: int, width_px: float) -> str:
    """Return text as one line that fits, with an ellipsis where it is cut."""
    return next(iter(text_lines(text, max(2, int(width_px / (_LETTER * size_px))), 1)), "")


def _text(css: str, x: float, y: float, text: str) -> str:
    return f'<text class="{css}" x="{x:.0f}" y="{y:.0f}">{escape(text)}</text>'
