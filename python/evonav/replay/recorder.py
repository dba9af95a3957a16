"""Record, as an agent runs, what records leave out of every round: colour views, beliefs and questions."""

import hashlib
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from evonav.agents.agent import Agent
from evonav.agents.explanation import MapBelief, explains, explanation_of
from evonav.decision.candidates import FrontierCandidate, ObjectCandidate
from evonav.decision.pictures import Picture
from evonav.decision.prompts import with_notice
from evonav.decision.query import QueryLogEntry
from evonav.decision.question import Question
from evonav.evaluation.episode.observer import EpisodeObserver
from evonav.evaluation.episode.outcome import StageOutcome
from evonav.evaluation.episode.staleness import entry_record, matched_object
from evonav.evaluation.hosting.process import AgentFailedError
from evonav.evaluation.records.floor_plans import FloorPlan
from evonav.evaluation.records.schema import ErrorKind, RoundRecord
from evonav.replay.types import (
    BLOCKED,
    EXPLORED,
    FREE,
    ReplayedEntry,
    ReplayedMap,
    ReplayedQuestion,
    ReplayedRound,
    ReplayedStage,
    ReplayedView,
    Truth,
)
from evonav.sensors.observation import Observation
from evonav.world.simulator import SceneObject, Simulator

HEADING_PX, SIDE_PX, QUALITY = 300, 150, 78
"""Longer edges of a round's heading view and of the others, and their JPEG quality ..."""
SMALL_HEADING_PX, SMALL_SIDE_PX, SMALL_QUALITY = 192, 96, 55
"""... and those of agents whose rounds are single actions: ten times as many."""
PROMPT_PX = 256
"""Longer edge of an image of a prompt, at most."""


@dataclass(frozen=True, slots=True)
class Loss:
    """The end of an agent's process, as recorded."""

    num_rounds: int
    """Whole ones before it, in its stage."""
    kind: ErrorKind
    message: str


class Recorder(EpisodeObserver):
    """Record what an agent does and believes as it runs, until `take`."""

    def __init__(
        self,
        agent: Agent,
        on_round: Callable[[int, int], None] = lambda _stage, _round: None,
        losses: Mapping[int, "Loss"] | None = None,
        heading_px: int | None = None,
        *,
        keeps_depth: bool = False,
        tells_of_change: bool = False,
    ) -> None:
        """Start without rounds.

        Args:
            on_round: Called with the stage and the round, from 0, as they begin.
            losses: Losses of the agent's process, by stage: there the agent does not act.
            heading_px: Longer edge of the heading views, where pages' own size is too small.
            tells_of_change: True if the run's prompts say that things may have been moved, see `with_notice`.
        """
        self._tells_of_change = tells_of_change
        self._keeps_depth = keeps_depth
        self.agent = agent
        self._on_round = on_round
        self._losses = losses or {}
        is_small = agent.sensors.motion == "actions"
        self._sizes = (SMALL_HEADING_PX, SMALL_SIDE_PX, SMALL_QUALITY) if is_small else (HEADING_PX, SIDE_PX, QUALITY)
        if heading_px is not None:
            self._sizes = (heading_px, SIDE_PX, 90)
        self._places: list[tuple[int, dict[str, list[SceneObject]]]] = []
        """Objects by category, of each arrangement of the house so far, with the stage."""
        self._now: dict[str, SceneObject] = {}
        self._truths: dict[tuple[str, tuple[float, float, float]], Truth | None] = {}
        self._prompt_jpegs: dict[bytes, bytes] = {}
        self._stage = 0
        self._rounds: list[ReplayedRound] = []
        self._pending: ReplayedRound | None = None
        self._fov_rad = 0.0

    def stage_begins(self, stage: int, simulator: Simulator) -> None:
        """Record where everything stands."""
        self._stage = stage
        self._rounds, self._pending = [], None
        self.house_changes(simulator)
        self._lose(0)

    def house_changes(self, simulator: Simulator) -> None:
        """Record where everything stands now."""
        self._simulator = simulator
        by_category: dict[str, list[SceneObject]] = {}
        for body in simulator.objects:
            by_category.setdefault(body.category, []).append(body)
        self._places.append((self._stage, by_category))
        self._now = {body.id: body for body in simulator.objects}
        self._truths.clear()

    def round_begins(self, observation: Observation) -> None:
        """Draw the views in colours; the agent's own stay as they are."""
        self._on_round(self._stage, len(self._rounds))
        heading_px, side_px, quality = self._sizes
        views = []
        for index, view in enumerate(observation.views):
            is_heading = index == len(observation.views) - 1
            rgb = view.rgb
            if rgb is None:
                rgb = self._simulator.render(replace(view.pose, y_m=observation.pose.y_m), instances=False).rgb
            assert rgb is not None
            jpeg = jpeg_of(rgb, heading_px if is_heading else side_px, quality)
            depth = depth_png(view.depth_m) if self._keeps_depth else None
            views.append(ReplayedView(view.pose, jpeg, depth))
            width_px, height_px = view.intrinsics.width_px, view.intrinsics.height_px
            self._fov_rad = 2 * math.atan(math.tan(view.intrinsics.vertical_fov_rad / 2) * width_px / height_px)
        self._pending = ReplayedRound(None, observation.pose, tuple(views))
        self._lose(len(self._rounds))

    def _lose(self, num_rounds: int) -> None:
        loss = self._losses.get(self._stage)
        if loss is not None and loss.num_rounds == num_rounds:
            raise AgentFailedError(loss.kind, loss.message)

    def round_ends(self, record: RoundRecord) -> None:
        """Add the agent's belief to the round."""
        if self._pending is not None:
            self._rounds.append(self._with_belief(replace(self._pending, record=record)))
        self._pending = None

    def take(self, outcome: StageOutcome, floor_plan: FloorPlan | None = None) -> ReplayedStage:
        """Return the stage that just ended; one that errored in the middle of a round has that round too."""
        rounds = self._rounds
        if self._pending is not None:
            rounds = [*rounds, self._with_belief(self._pending)]
        self._rounds, self._pending = [], None
        return ReplayedStage(outcome.record, floor_plan, tuple(rounds), "", (), self._fov_rad)

    def _with_belief(self, seen: ReplayedRound) -> ReplayedRound:
        if not explains(self.agent):
            return seen
        try:
            found = explanation_of(self.agent)
            believed = found.map_belief()
            _, bodies = self._places[-1]
            entries = [entry_record(entry, bodies) for entry in found.entries()]
            return replace(
                seen,
                entries=tuple(ReplayedEntry(entry, self._truth(entry.label, entry.centre_m)) for entry in entries),
                candidate_ids=tuple(found.candidate_ids),
                frontiers=() if believed is None else tuple(believed.frontiers),
                map=None if believed is None else _map_of(believed),
                places=found.place_belief(),
                questions=tuple(self._question(entry) for entry in found.questions),
            )
        except Exception as error:  # a picture is not worth an episode: the page says what is missing
            return replace(seen, note=f"the agent's belief cannot be read: {type(error).__name__}: {error}")

    def _question(self, entry: QueryLogEntry) -> ReplayedQuestion:
        parts: list[tuple[str, str | bytes]] = []
        for turn in with_notice(entry.question.prompt(), tells_of_change=self._tells_of_change).turns:
            for part in turn.parts:
                shown = self._shown(part.pixels) if isinstance(part, Picture) else part
                parts.append((turn.role, shown))
        answer = entry.text
        while answer.startswith(f"{entry.outcome}: "):  # the message of a fault begins with its name
            answer = answer.removeprefix(f"{entry.outcome}: ")
        return ReplayedQuestion(
            entry.question.kind, tuple(parts), answer, entry.outcome, tuple(_offered(entry.question))
        )

    def _shown(self, pixels: NDArray[np.uint8]) -> bytes:
        """Return an image of a prompt as JPEG; the same ones come again round after round."""
        key = hashlib.blake2b(pixels.tobytes(), person=f"{pixels.shape[1]}".encode()).digest()
        if key not in self._prompt_jpegs:
            self._prompt_jpegs[key] = jpeg_of(pixels, PROMPT_PX, QUALITY)
        return self._prompt_jpegs[key]

    def _truth(self, label: str, centre_m: tuple[float, float, float]) -> Truth | None:
        """Find the object where an entry is, or the last one of its label that stood there in an earlier stage."""
        key = (label, centre_m)
        if key not in self._truths:
            self._truths[key] = self._found(label, centre_m)
        return self._truths[key]

    def _found(self, label: str, centre_m: tuple[float, float, float]) -> Truth | None:
        for stage, bodies in reversed(self._places):
            body = matched_object(label, centre_m, bodies)
            if body is not None:
                now = self._now.get(body.id)
                return Truth(body.id, stage, None if now is None else now.centre_m)
        return None


def jpeg_of(pixels: NDArray[np.uint8], longest_px: int, quality: int) -> bytes:
    """Return a picture, `(H, W, 3)` RGB, as JPEG of a quality of 1 to 95, its longer edge at most `longest_px`."""
    picture = Image.fromarray(np.ascontiguousarray(pixels))
    if max(picture.size) > longest_px:
        picture.thumbnail((longest_px, longest_px))
    buffer = BytesIO()
    picture.save(buffer, "JPEG", quality=quality, optimize=True)
    return buffer.getvalue()


def depth_png(depth_m: NDArray[np.float32]) -> bytes:
    """Return depth as a PNG of 16 bits in whole millimetres; 0 where there is none, or more than it holds (65.5 m)."""
    depth_mm = np.round(np.where(np.isfinite(depth_m), depth_m, 0.0) * 1000.0)
    millimetres = np.where((depth_mm > 0) & (depth_mm < 2**16), depth_mm, 0).astype(np.uint16)
    buffer = BytesIO()
    Image.fromarray(millimetres).save(buffer, "PNG")
    return buffer.getvalue()


def _map_of(belief: MapBelief) -> ReplayedMap:
    cells = np.where(belief.cells == FREE, FREE, np.where(belief.cells == BLOCKED, BLOCKED, 0)).astype(np.uint8)
    if belief.explored is not None:
        cells[(cells == FREE) & belief.explored] = EXPLORED
    frame = belief.map_frame
    return ReplayedMap(cells, frame.cell_m, frame.corner_m)


def _offered(question: Question[Any]) -> Iterator[tuple[str, str, int]]:
    """Yield entries and frontiers with their names in the prompt, where a question has lists of them."""

    def objects(candidates: Any, before: str) -> Iterator[tuple[str, str, int]]:  # noqa: ANN401
        for index, candidate in enumerate(candidates):
            if isinstance(candidate, ObjectCandidate):
                yield f"{before}Object {index}", candidate.label, candidate.entry_id

    yield from objects(getattr(question, "objects", ()), "")
    for number, snapshot in enumerate(getattr(question, "snapshots", ())):
        yield from objects(getattr(snapshot, "objects", ()), f"Snapshot {number}, ")
    for index, candidate in enumerate(getattr(question, "frontiers", ())):
        if isinstance(candidate, FrontierCandidate):
            yield f"Frontier {index}", "frontier", candidate.frontier_id
