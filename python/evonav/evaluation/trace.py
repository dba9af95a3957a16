"""Runs recorded episodes again in this process, and keeps of every round what records leave out (`evonav view`).

A deterministic agent does the same again, with a model's answers taken from the kept exchanges; that the new records
equal the stored ones, byte for byte, is checked and told. Where an agent's process died or hung, the replay ends the
stage in that round without asking the agent, and goes on with a fresh one, as the run did. What cannot be run again
(the evaluator's own process was lost) is shown as it was recorded. Nothing here runs in an evaluation.
"""

import hashlib
import inspect
import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from evonav.agents.agent import Agent, Belief, InspectableAgent
from evonav.agents.registry import imported
from evonav.decision.asking import Asked
from evonav.decision.own import own_model
from evonav.decision.prompts import Picture
from evonav.decision.questions.candidates import FrontierCandidate, ObjectCandidate
from evonav.decision.questions.question import Question
from evonav.errors import InvalidArgumentError, StoreError
from evonav.evaluation.backend import Backend, make_agent
from evonav.evaluation.engine import agent_seed
from evonav.evaluation.protocol import AgentFailedError, EpisodeCase, ProtocolConfig, StageOutcome
from evonav.evaluation.record_parts import STALE_MARGIN_M, distance_to_box_m, entry_record, pose_record
from evonav.evaluation.records import EndState, ErrorKind, RoundRecord, StageMap, StageRecord
from evonav.evaluation.rollout import LOSSES, Episode
from evonav.evaluation.store import RunStore
from evonav.evaluation.traced import (
    BLOCKED,
    EXPLORED,
    FREE,
    TracedEntry,
    TracedFrontier,
    TracedMap,
    TracedQuestion,
    TracedRound,
    TracedStage,
    TracedView,
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
EXCHANGES_NAME = "exchanges.sqlite"
"""In the folder of a run that asked a model."""
MAX_DIFFERENCES = 5


class RunReplay:
    """The episodes of a run, by agent and task."""

    def __init__(self, run_dir: Path, task_path: Callable[[str], Path], exchanges: Path | None = None) -> None:
        """Reads a run's header.

        Args:
            run_dir: A run.
            task_path: Folder of a task, by its id.
            exchanges: Answers of a model; default: those kept in the run's folder.

        Raises:
            StoreError: There is no run, or its header cannot be read.
        """
        self._run_dir = run_dir
        self._task_path = task_path
        with RunStore(run_dir) as store:
            config = store.meta("config") or {}
        try:
            self.seed = int(config["seed"])
            self.protocol = ProtocolConfig(**config["protocol"])
            backend = Backend(**config["backend"])
        except (KeyError, TypeError, ValueError) as error:
            raise StoreError(f"{run_dir}: header of the run: {type(error).__name__}: {error}") from error
        self.backend = backend
        self._why_not = ""
        if "exchanges" in inspect.signature(imported(backend.decision)).parameters:
            path = exchanges or run_dir / EXCHANGES_NAME
            if path.is_file():
                self.backend = replace(backend, decision_host_options={"exchanges": str(path), "mode": "replay"})
            elif not _answers_itself(backend):
                self._why_not = f"The model's answers were not kept: {path} not found."

    def budget(self, agent: str) -> int:
        """Rounds that an agent has in a stage."""
        return self.protocol.budget(make_agent(agent).sensing)

    def episode(
        self,
        agent: str,
        task_id: str,
        on_round: Callable[[int, int], None] = lambda _stage, _round: None,
        *,
        last_stage: int | None = None,
    ) -> Iterator[TracedStage]:
        """The stages of an episode that have a record.

        Args:
            agent: One of the run's.
            task_id: One of its tasks.
            on_round: Told the stage and the round, 0-based, as they begin.
            last_stage: Where to end.

        Raises:
            InvalidArgumentError: The run has no record of this episode.
            StoreError: The run cannot be read.
            TaskError: The task cannot be read.
        """
        with RunStore(self._run_dir) as store:
            stored = {record.stage: record for record in store.records(agent, task_id)}
            texts = dict(zip(stored, store.record_texts(agent, task_id), strict=True))
            stored = {k: record for k, record in stored.items() if last_stage is None or k <= last_stage}
            maps = {stage_map.stage: stage_map for stage_map in store.maps(task_id)}
        if not stored:
            raise InvalidArgumentError(f"{self._run_dir}: no record of task {task_id!r} by agent {agent!r}")
        case = self.backend.load_case(self._task_path(task_id))
        for stage in self._stages(case, agent, stored, maps, on_round):
            yield replace(stage, differences=_differences(texts.get(stage.record.stage), stage))

    def _stages(
        self,
        case: EpisodeCase,
        agent_name: str,
        stored: Mapping[int, StageRecord],
        maps: Mapping[int, StageMap],
        on_round: Callable[[int, int], None],
    ) -> Iterator[TracedStage]:
        lost = [stage for stage, record in stored.items() if _is_beyond_replay(record)]
        # Run again up to here.
        last = 0 if self._why_not else min([max(stored) + 1, *lost]) - 1
        fov_rad = 0.0
        if last > 0:
            with closing(self.backend.make_simulator()) as simulator:
                seed = agent_seed(self.seed, agent_name, case.task_id)
                agent = make_agent(agent_name, self.backend.make_decision(seed))
                tracer = Tracer(agent, on_round, {stage: loss for stage in stored if (loss := _loss(stored[stage]))})
                perception = self.backend.make_perception()
                episode = Episode(case, agent_name, agent, simulator, perception, self.protocol, seed, tracer)
                for outcome in episode.run():
                    traced = tracer.take(outcome)
                    fov_rad = traced.fov_rad
                    yield traced
                    if outcome.record.stage == last:
                        break
                    if _loss(outcome.record):
                        tracer.agent = make_agent(agent_name, self.backend.make_decision(seed))
                        episode.replace_agent(tracer.agent)
        for number, record in stored.items():
            if number > last:
                why_not = self._why_not or _why_not(record, number == last + 1)
                yield TracedStage(record, maps.get(number), _recorded_rounds(record), why_not, (), fov_rad)


@dataclass(frozen=True, slots=True)
class Loss:
    """The end of an agent's process, as recorded."""

    num_rounds: int
    """Whole ones before it, in its stage."""
    kind: ErrorKind
    message: str


class Tracer:
    """Looks on as an agent runs, and keeps what it sees until `take`."""

    def __init__(
        self,
        agent: Agent,
        on_round: Callable[[int, int], None] = lambda _stage, _round: None,
        losses: Mapping[int, "Loss"] | None = None,
    ) -> None:
        """Looks on.

        Args:
            agent: The one that runs.
            on_round: Told the stage and the round, 0-based, as they begin.
            losses: Where the agent's process was lost, by stage: there it is not asked.
        """
        self.agent = agent
        self._on_round = on_round
        self._losses = losses or {}
        is_small = agent.sensing.motion == "actions"
        self._sizes = (SMALL_HEADING_PX, SMALL_SIDE_PX, SMALL_QUALITY) if is_small else (HEADING_PX, SIDE_PX, QUALITY)
        self._places: list[dict[str, list[SceneObject]]] = []
        """Objects by category, of each stage so far."""
        self._now: dict[str, SceneObject] = {}
        self._truths: dict[tuple[str, tuple[float, float, float]], Truth | None] = {}
        self._prompt_jpegs: dict[bytes, bytes] = {}
        self._stage = 0
        self._rounds: list[TracedRound] = []
        self._pending: TracedRound | None = None
        self._fov_rad = 0.0

    def stage_begins(self, stage: int, simulator: Simulator) -> None:
        """Takes note of where everything stands."""
        self._stage = stage
        self._simulator = simulator
        by_category: dict[str, list[SceneObject]] = {}
        for body in simulator.objects:
            by_category.setdefault(body.category, []).append(body)
        self._places.append(by_category)
        self._now = {body.id: body for body in simulator.objects}
        self._truths.clear()
        self._rounds, self._pending = [], None
        self._lose(0)

    def round_begins(self, observation: Observation) -> None:
        """Draws the views in colours; the agent's own stay as they are."""
        self._on_round(self._stage, len(self._rounds))
        heading_px, side_px, quality = self._sizes
        views = []
        for index, view in enumerate(observation.views):
            is_heading = index == len(observation.views) - 1
            rgb = view.rgb
            if rgb is None:
                rgb = self._simulator.render(replace(view.pose, y_m=observation.pose.y_m), instances=False).rgb
            assert rgb is not None
            views.append(TracedView(view.pose.yaw_rad, jpeg_of(rgb, heading_px if is_heading else side_px, quality)))
            width_px, height_px = view.intrinsics.width_px, view.intrinsics.height_px
            self._fov_rad = 2 * math.atan(math.tan(view.intrinsics.vertical_fov_rad / 2) * width_px / height_px)
        self._pending = TracedRound(None, pose_record(observation.pose), tuple(views))
        self._lose(len(self._rounds))

    def _lose(self, num_rounds: int) -> None:
        loss = self._losses.get(self._stage)
        if loss is not None and loss.num_rounds == num_rounds:
            raise AgentFailedError(loss.kind, loss.message)

    def round_ends(self, record: RoundRecord) -> None:
        """Asks the agent what it holds true."""
        if self._pending is not None:
            self._rounds.append(self._with_belief(replace(self._pending, record=record)))
        self._pending = None

    def take(self, outcome: StageOutcome) -> TracedStage:
        """The stage that just ended; one that errored in the middle of a round has that round too."""
        rounds = self._rounds
        if self._pending is not None:
            rounds = [*rounds, self._with_belief(self._pending)]
        self._rounds, self._pending = [], None
        return TracedStage(outcome.record, outcome.stage_map, tuple(rounds), "", (), self._fov_rad)

    def _with_belief(self, seen: TracedRound) -> TracedRound:
        if not isinstance(self.agent, InspectableAgent):
            return seen
        try:
            belief = self.agent.belief()
            bodies = self._places[-1]
            entries = [entry_record(entry, bodies) for entry in belief.entries]
            return replace(
                seen,
                entries=tuple(TracedEntry(entry, self._truth(entry.label, entry.centre_m)) for entry in entries),
                candidate_ids=tuple(belief.candidate_ids),
                frontiers=tuple(TracedFrontier(f.frontier_id, f.position_m, f.direction_rad) for f in belief.frontiers),
                map=_map_of(belief),
                asked=tuple(self._question(asked) for asked in belief.asked),
            )
        except Exception as error:  # a picture is not worth an episode: the page says what is missing
            return replace(seen, note=f"the agent tells no belief: {type(error).__name__}: {error}")

    def _question(self, asked: Asked) -> TracedQuestion:
        parts: list[tuple[str, str | bytes]] = []
        for turn in asked.question.prompt().turns:
            for part in turn.parts:
                shown = self._shown(part.pixels) if isinstance(part, Picture) else part.text
                parts.append((turn.role, shown))
        answer = asked.text
        while answer.startswith(f"{asked.outcome}: "):  # what is told of a fault begins with its name
            answer = answer.removeprefix(f"{asked.outcome}: ")
        return TracedQuestion(asked.question.kind, tuple(parts), answer, asked.outcome, tuple(_offered(asked.question)))

    def _shown(self, pixels: NDArray[np.uint8]) -> bytes:
        """An image of a prompt; the same ones come again round after round."""
        key = hashlib.blake2b(pixels.tobytes(), person=f"{pixels.shape[1]}".encode()).digest()
        if key not in self._prompt_jpegs:
            self._prompt_jpegs[key] = jpeg_of(pixels, PROMPT_PX, QUALITY)
        return self._prompt_jpegs[key]

    def _truth(self, label: str, centre_m: tuple[float, float, float]) -> Truth | None:
        """What stands where an entry is, or stood there in the latest stage in which something of its label did."""
        key = (label, centre_m)
        if key not in self._truths:
            self._truths[key] = self._found(label, centre_m)
        return self._truths[key]

    def _found(self, label: str, centre_m: tuple[float, float, float]) -> Truth | None:
        for index in reversed(range(len(self._places))):
            near = [
                (distance_m, math.dist(body.centre_m, centre_m), body.id)
                for body in self._places[index].get(label, ())
                if (distance_m := distance_to_box_m(centre_m, body)) <= STALE_MARGIN_M
            ]
            if near:
                object_id = min(near)[2]
                now = self._now.get(object_id)
                return Truth(object_id, index + 1, None if now is None else now.centre_m)
        return None


def jpeg_of(pixels: NDArray[np.uint8], longest_px: int, quality: int) -> bytes:
    """A picture as JPEG, its longer edge at most `longest_px`.

    Args:
        pixels: `(H, W, 3)` RGB.
        longest_px: Of the longer edge.
        quality: Of JPEG, 1 to 95.
    """
    picture = Image.fromarray(np.ascontiguousarray(pixels))
    if max(picture.size) > longest_px:
        picture.thumbnail((longest_px, longest_px))
    buffer = BytesIO()
    picture.save(buffer, "JPEG", quality=quality, optimize=True)
    return buffer.getvalue()


def _answers_itself(backend: Backend) -> bool:
    """Whether the model is one of the user's own that is put the questions themselves: nothing of it is kept."""
    path = backend.decision_options.get("path")
    return path is not None and hasattr(own_model(str(path), 0), "answer")


def _loss(record: StageRecord) -> Loss | None:
    """The loss of the agent's process in a stage, if there was one."""
    error = record.error
    if record.state is not EndState.ERRORED or error is None or error.kind not in LOSSES:
        return None
    return Loss(len(record.trace), error.kind, error.message)


def _is_beyond_replay(record: StageRecord) -> bool:
    """Whether more than the agent was lost: a stage that was not even begun, or the simulator."""
    if record.state is not EndState.ERRORED or record.error is None:
        return False
    return record.error.kind is ErrorKind.SIMULATOR_LOST or (
        _loss(record) is not None and record.effective_start is None
    )


def _why_not(record: StageRecord, is_first: bool) -> str:
    if is_first and record.error is not None:
        return f"It ended with the loss of a process ({record.error.kind.value}): {record.error.message}."
    return "A stage before it cannot be run again."


def _recorded_rounds(record: StageRecord) -> tuple[TracedRound, ...]:
    return tuple(TracedRound(entry, entry.pose, ()) for entry in record.trace)


def _map_of(belief: Belief) -> TracedMap:
    cells = np.where(belief.cells == FREE, FREE, np.where(belief.cells == BLOCKED, BLOCKED, 0)).astype(np.uint8)
    if belief.explored is not None:
        cells[(cells == FREE) & belief.explored] = EXPLORED
    frame = belief.map_frame
    return TracedMap(cells, frame.cell_m, frame.corner_m)


def _offered(question: Question[Any]) -> Iterator[tuple[str, str, int]]:
    """Entries and frontiers by the names that the prompt gives them, where a question has lists of them."""

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


def _differences(stored: str | None, stage: TracedStage) -> tuple[str, ...]:
    """Where a replayed record departs from the stored one."""
    if stored is None or not stage.is_replayed:
        return ()
    text = stage.record.model_dump_json()
    if text == stored:
        return ()
    found = list(_departures(json.loads(stored), json.loads(text), ""))
    return tuple(found[:MAX_DIFFERENCES]) or ("the same values in other bytes",)


def _departures(was: Any, is_now: Any, where: str) -> Iterator[str]:  # noqa: ANN401 - JSON
    if isinstance(was, dict) and isinstance(is_now, dict):
        for key in dict.fromkeys([*was, *is_now]):
            yield from _departures(was.get(key), is_now.get(key), f"{where}.{key}" if where else key)
    elif isinstance(was, list) and isinstance(is_now, list) and len(was) == len(is_now):
        for index, (a, b) in enumerate(zip(was, is_now, strict=True)):
            yield from _departures(a, b, f"{where}[{index}]")
    elif was != is_now:
        yield f"{where}: {_short(was)} stored, {_short(is_now)} replayed"


def _short(value: Any) -> str:  # noqa: ANN401 - JSON
    if isinstance(value, Sequence) and not isinstance(value, str):
        return f"{len(value)} items"
    text = json.dumps(value)
    return text if len(text) <= 60 else f"{text[:59]}…"
