"""The pictures of `evonav video`: what the agent saw, what it believed and what was true, side by side."""

from collections.abc import Iterator, Mapping, Sequence
from io import BytesIO

import numpy as np
from PIL import Image, ImageDraw

from evonav.evaluation.records.schema import EndState, StageMap
from evonav.replay.page_data import choice_words, evaluator_words
from evonav.replay.types import TracedEntry, TracedRound, TracedStage
from evonav.report.canvas import Colour, MapCanvas, colour, font, plain, wrapped
from evonav.report.maps.floor_plan import Frame
from evonav.report.maps.stage_map import change_words, outcome_words, task_frame
from evonav.report.maps.svg import cm
from evonav.report.tables.causes import sentence
from evonav.tasks.language import noun_of

SIZE = (1280, 720)
MARGIN = 16
TOP = 122
VIEW_PX = 396
MAP_SIZE = (414, 414)
SIDE_PX = 96
LEFTS = (MARGIN, MARGIN + VIEW_PX + 14, MARGIN + VIEW_PX + 14 + MAP_SIZE[0] + 10)
ENTRY: Colour = (15, 118, 110)
CHOSEN: Colour = (194, 65, 12)
TRAIL: Colour = (47, 102, 203)
_CELLS = np.array([(138, 147, 163, 102), (47, 102, 203, 33), (39, 48, 67, 158), (59, 151, 234, 77)], np.uint8)
"""RGBA of unknown, free, blocked and explored cells, as in the viewer."""


def stage_frames(
    stage: TracedStage, maps: Mapping[int, StageMap], frame: Frame, *, budget: int, success_radius_m: float
) -> Iterator[Image.Image]:
    """A picture a round, and one that tells how the stage ended.

    Args:
        stage: As replayed.
        maps: Of the task, by stage.
        frame: That all of the task's maps share.
        budget: Rounds that the agent had.
        success_radius_m: Of the ring around the target.
    """
    painter = _StagePainter(stage, maps, frame, budget, success_radius_m)
    for index in range(len(stage.rounds)):
        yield painter.round(index)
    yield painter.end()


def episode_frame(stages: Sequence[TracedStage], maps: Mapping[int, StageMap]) -> Frame:
    """The frame of a task's maps."""
    return task_frame(maps, [stage.record for stage in stages])


class _StagePainter:
    """What the pictures of a stage share is drawn once."""

    def __init__(
        self, stage: TracedStage, maps: Mapping[int, StageMap], frame: Frame, budget: int, radius_m: float
    ) -> None:
        record = stage.record
        self._stage, self._record, self._budget = stage, record, budget
        self._frame = frame
        house = maps.get(record.stage)
        self._belief = MapCanvas(frame, MAP_SIZE)
        self._truth = MapCanvas(frame, MAP_SIZE)
        if house is not None:
            self._truth.house(house)
            self._truth.moved(record.transition.relocations, house, maps.get(record.stage - 1))
            self._truth.room_names(house, 13)
        target = cm((record.target.position_m[0], record.target.position_m[2]))
        self._truth.ring(target, 100 * radius_m)
        first = record.target.first_position_m
        if first is not None:
            self._truth.star(cm((first[0], first[2])), 2.4, None)
        self._target = target
        self._house = house
        self._head = self._header(maps)

    def round(self, index: int) -> Image.Image:
        """One round."""
        step = self._stage.rounds[index]
        picture = self._head.copy()
        draw = ImageDraw.Draw(picture)
        where = (
            f"stage {self._record.stage} of {self._record.num_stages} · round {index + 1} of {len(self._stage.rounds)}"
        )
        where += f" (budget {self._budget})"
        draw.text((SIZE[0] - MARGIN, 27), where, font=font(18), fill=colour("ink"), anchor="rm")
        self._views(picture, step)
        trail = self._trail(index)
        picture.paste(self._belief_map(step, trail), (LEFTS[1], TOP))
        picture.paste(self._truth_map(step, trail), (LEFTS[2], TOP))
        self._captions(draw, step)
        self._timeline(draw, index)
        return picture

    def end(self) -> Image.Image:
        """The last round again, with how the stage ended."""
        record = self._record
        picture = self.round(len(self._stage.rounds) - 1) if self._stage.rounds else self._head.copy()
        draw = ImageDraw.Draw(picture)
        top = TOP + MAP_SIZE[1] + 26
        draw.rectangle((0, top - 8, SIZE[0], SIZE[1] - 14), fill=colour("paper"))
        ink = {EndState.SUCCESS: colour("ok"), EndState.FAILURE: colour("bad")}.get(record.state, colour("orange"))
        words = plain(outcome_words(record))
        draw.rounded_rectangle((MARGIN, top + 8, MARGIN + 28 + font(26).getlength(words), top + 52), 10, fill=ink)
        draw.text((MARGIN + 14, top + 30), words, font=font(26), fill="white", anchor="lm")
        for i, line in enumerate(wrapped(sentence(record), 20, SIZE[0] - 2 * MARGIN, 2)):
            draw.text((MARGIN, top + 72 + 26 * i), line, font=font(20), fill=colour("ink"))
        return picture

    def _header(self, maps: Mapping[int, StageMap]) -> Image.Image:
        record = self._record
        picture = Image.new("RGB", SIZE, colour("paper"))
        draw = ImageDraw.Draw(picture)
        agent = plain(record.agent)[-40:]
        draw.text((MARGIN, 27), agent, font=font(26), fill=colour("ink"), anchor="lm")
        x = MARGIN + font(26).getlength(agent) + 14
        task = wrapped(record.task_id, 16, SIZE[0] - 460 - x, 1)[0]
        draw.text((x, 29), task, font=font(16), fill=colour("soft"), anchor="lm")
        goal = wrapped(record.goal.instruction, 20, SIZE[0] - 2 * MARGIN, 1)[0]
        draw.text((MARGIN, 62), goal, font=font(20), fill=TRAIL, anchor="lm")
        changed = wrapped(change_words(record, maps), 15, MAP_SIZE[0], 1)[0]
        heads = ("what it sees", "what it believes: map and memory", f"what is true: {changed}")
        inks = (colour("soft"), colour("soft"), colour("orange") if record.transition.relocations else colour("soft"))
        for left, words, ink, width in zip(LEFTS, heads, inks, (VIEW_PX, *MAP_SIZE), strict=True):
            draw.text((left, TOP - 9), wrapped(words, 15, width, 1)[0], font=font(15), fill=ink, anchor="ls")
        draw.line((0, 84, SIZE[0], 84), fill=(226, 229, 234))
        return picture

    def _views(self, picture: Image.Image, step: TracedRound) -> None:
        if not step.views:
            return
        seen = Image.open(BytesIO(step.views[-1].jpeg))
        has_sides = len(step.views) > 1
        size = VIEW_PX - 92 if has_sides else VIEW_PX
        heading = seen.resize(_fitting(seen.size, VIEW_PX, size), Image.Resampling.LANCZOS)
        picture.paste(heading, (LEFTS[0] + (VIEW_PX - heading.width) // 2, TOP))
        sides = step.views[:-1]
        if sides:
            width = min(SIDE_PX, (VIEW_PX - 4 * (len(sides) - 1)) // len(sides))
            for i, view in enumerate(sides):
                side = Image.open(BytesIO(view.jpeg))
                small = side.resize(_fitting(side.size, width, SIDE_PX), Image.Resampling.LANCZOS)
                picture.paste(small, (LEFTS[0] + i * (width + 4), TOP + heading.height + 8))

    def _trail(self, index: int) -> list[list[tuple[int, int]]]:
        """The way of each round so far."""
        records = (step.record for step in self._stage.rounds[: index + 1])
        return [[cm(point) for point in record.path_m] for record in records if record is not None]

    def _belief_map(self, step: TracedRound, trail: Sequence[list[tuple[int, int]]]) -> Image.Image:
        canvas = self._belief.copy()
        if step.map is not None:
            canvas.cells(step.map.cells, 100 * step.map.cell_m, cm(step.map.corner_m), _CELLS)
            chosen = None if step.record is None else step.record.chosen_entry
            for entry in sorted(step.entries, key=lambda e: e.record.entry_id in step.candidate_ids):
                self._entry(
                    canvas, entry, step, is_chosen=chosen is not None and entry.record.entry_id == chosen.entry_id
                )
            for frontier in step.frontiers:
                x, y = cm(frontier.position_m)
                r = 1.3 * self._frame.unit
                canvas.polygon([(x, y - r), (x + r, y), (x, y + r), (x - r, y)], colour("t1"), colour("paper"))
        self._way(canvas, step, trail)
        picture = canvas.small()
        draw = ImageDraw.Draw(picture)
        if step.map is None:
            words = step.note or "this agent does not tell what it believes"
            for i, line in enumerate(wrapped(words, 15, MAP_SIZE[0] - 20, 3)):
                draw.text((10, 14 + 19 * i), line, font=font(15), fill=colour("soft"))
        else:
            num_stale = sum(entry.record.is_stale for entry in step.entries)
            words = f"{len(step.entries)} entries, {num_stale} stale (red; the evaluator's knowledge)"
            draw.text((4, MAP_SIZE[1] - 4), words, font=font(13), fill=colour("soft"), anchor="ls")
        return picture

    def _entry(self, canvas: MapCanvas, entry: TracedEntry, step: TracedRound, *, is_chosen: bool) -> None:
        belief, u = entry.record, self._frame.unit
        x, y = cm((belief.centre_m[0], belief.centre_m[2]))
        width, depth = (
            min(600.0, max(1.4 * u, 100 * abs(edge))) if np.isfinite(edge) else 1.4 * u
            for edge in (belief.size_m[0], belief.size_m[2])
        )
        box = [
            (x - width / 2, y - depth / 2),
            (x + width / 2, y - depth / 2),
            (x + width / 2, y + depth / 2),
            (x - width / 2, y + depth / 2),
        ]
        ink = colour("red") if belief.is_stale else CHOSEN if is_chosen else ENTRY
        is_candidate = belief.entry_id in step.candidate_ids
        canvas.polygon(
            box, ink, ink, alpha=90 if is_chosen else 50 if is_candidate else 20, width=0.75 if is_chosen else 0.35
        )
        if belief.is_stale:
            canvas.cross((x, y), min(0.9, width / 2 / u), colour("red"))
        if is_chosen or belief.label == self._record.goal.category:
            canvas.words(f"{noun_of(belief.label)} #{belief.entry_id}", (x, y - depth / 2 - 1.6 * u), 12, ink)

    def _truth_map(self, step: TracedRound, trail: Sequence[list[tuple[int, int]]]) -> Image.Image:
        canvas = self._truth.copy()
        for entry in step.entries:
            belief, truth = entry.record, entry.truth
            is_goal = truth is not None and truth.object_id == self._record.target.object_id
            if belief.is_stale and truth is not None and truth.now_m is not None and is_goal:
                ends = [cm((point[0], point[2])) for point in (belief.centre_m, truth.now_m)]
                canvas.line(ends, colour("red"), 0.45, dash=1.0)
                canvas.cross(ends[0], 1.4, colour("red"))
        canvas.star(self._target, 2.9, colour("gold"))
        self._way(canvas, step, trail)
        return canvas.small()

    def _way(self, canvas: MapCanvas, step: TracedRound, trail: Sequence[list[tuple[int, int]]]) -> None:
        start = self._record.effective_start
        if start is not None:
            canvas.disc(cm((start.x_m, start.z_m)), canvas.unit(1.4), colour("paper"), colour("ink"), width=0.6)
        for piece in trail[:-1] if step.record is not None else trail:
            canvas.line(piece, TRAIL, 0.9)
        if step.record is not None:
            canvas.line(trail[-1], CHOSEN, 1.0)
            action = step.record.action
            if action.position_m is not None:
                goal = cm(action.position_m)
                canvas.line([trail[-1][-1], goal], CHOSEN, 0.4, alpha=150, dash=1.0)
                canvas.disc(goal, canvas.unit(0.8), None, CHOSEN)
        at = cm((step.pose.x_m, step.pose.z_m))
        for view in step.views[:-1]:
            canvas.cone(at, view.pose.yaw_rad, self._stage.fov_rad, 9 * self._frame.unit, 22)
        canvas.cone(at, step.pose.yaw_rad, self._stage.fov_rad, 12 * self._frame.unit, 80)
        canvas.disc(at, canvas.unit(1.5), colour("ink"), colour("paper"), width=0.5)

    def _captions(self, draw: ImageDraw.ImageDraw, step: TracedRound) -> None:
        top, width = TOP + MAP_SIZE[1] + 30, SIZE[0] - 2 * MARGIN
        record = step.record
        choice = "error" if record is None else choice_words(record)
        draw.text((MARGIN, top), wrapped(choice, 22, width, 1)[0], font=font(22), fill=CHOSEN)
        lines: list[tuple[str, Colour]] = []
        if step.asked:
            last = step.asked[-1]
            lines.append((f"asked ({last.kind}), {last.outcome}: {last.answer}", colour("ink")))
        if record is not None and record.action.reason:
            lines.append((f"because: {record.action.reason}", colour("ink")))
        if words := evaluator_words(self._record, step):
            lines.append((f"evaluator: {words}", colour("red")))
        if record is not None and record.is_target_visible:
            lines.append(("the target is in view", colour("ring")))
        y = top + 32
        for words, ink in lines:
            for line in wrapped(words, 17, width, 2):
                if y > SIZE[1] - 36:
                    return
                draw.text((MARGIN, y), line, font=font(17), fill=ink)
                y += 22

    def _timeline(self, draw: ImageDraw.ImageDraw, index: int) -> None:
        num = len(self._stage.rounds)
        for i, step in enumerate(self._stage.rounds):
            left, right = SIZE[0] * i / num, SIZE[0] * (i + 1) / num
            entry = None if step.record is None else step.record.chosen_entry
            ink = colour("t1") if entry is None else colour("red") if entry.is_stale else ENTRY
            ink = ink if i <= index else (226, 229, 234)
            draw.rectangle((left, SIZE[1] - 8, right - (1 if num < 200 else 0), SIZE[1]), fill=ink)


def _fitting(size: tuple[int, int], width: int, height: int) -> tuple[int, int]:
    """A picture's size in a box."""
    scale = min(width / size[0], height / size[1])
    return (max(1, round(size[0] * scale)), max(1, round(size[1] * scale)))
