"""Run recorded episodes again in this process, and collect what records leave out of every round (`evonav view`).

A deterministic agent does the same again, with a model's answers taken from the stored ones. The new records are
compared with the stored ones, byte for byte, and differences are reported. Where an agent's process died or hung, the
replay ends the stage in that round without asking the agent, and goes on with a fresh one, as the run did. What cannot
be run again (the evaluator's own process was lost) is shown as it was recorded. Nothing here runs in an evaluation.
"""

import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from dataclasses import replace
from difflib import get_close_matches
from pathlib import Path

from evonav.component import import_callable
from evonav.decision.backends import custom, vlm
from evonav.decision.custom_model import load_custom_model
from evonav.decision.question import DecisionModel
from evonav.errors import InvalidArgumentError, StoreError
from evonav.evaluation.episode.episode import Episode
from evonav.evaluation.episode.spec import EpisodeSpec, opaque_task_id
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.floor_plans import FloorPlan
from evonav.evaluation.records.record_diff import record_differences
from evonav.evaluation.records.schema import EndState, ErrorKind, StageRecord
from evonav.evaluation.records.store import RunStore
from evonav.evaluation.run.components import Backend, make_agent
from evonav.evaluation.run.run import NAMES_KEY, agent_seed, perception_seed
from evonav.evaluation.run.settings import EXCHANGES_NAME
from evonav.perception.weights import MODELS_VARIABLE
from evonav.replay.recorder import Loss, Recorder
from evonav.replay.types import ReplayedRound, ReplayedStage


def _near(run_dir: Path, task_id: str) -> str:
    """Return a hint at the task of a run with the most similar name."""
    with RunStore(run_dir) as store:
        names = sorted(store.meta("num_stages") or {})
    near = get_close_matches(task_id, names, 1, cutoff=0.0)
    return f"; there is {near[0]}" if near else ""


class RunReplay:
    """The episodes of a run, by agent and task."""

    def __init__(
        self,
        run_dir: Path,
        task_path: Callable[[str], Path],
        response_cache: Path | None = None,
        *,
        heading_px: int | None = None,
        keeps_depth: bool = False,
    ) -> None:
        """Read a run's header.

        Args:
            task_path: Folder of a task, by its id.
            response_cache: Stored answers of a model; default: the file in the run's folder.
            heading_px: Longer edge of the heading views; default: that of the pages of `evonav view`.

        Raises:
            StoreError: There is no run, or its header cannot be read.
        """
        self._run_dir = run_dir
        self._task_path = task_path
        self._heading_px = heading_px
        self._keeps_depth = keeps_depth
        with RunStore(run_dir) as store:
            config = store.meta("config") or {}
            models = store.meta("models_dir")
            self._secret: str = store.meta(NAMES_KEY) or ""
        try:
            self.seed = int(config["seed"])
            self.protocol = ProtocolConfig(**config["protocol"])
            backend = Backend.from_identity(config["backend"])
        except (KeyError, TypeError, ValueError) as error:
            raise StoreError(f"{run_dir}: header of the run: {type(error).__name__}: {error}") from error
        if models is not None and MODELS_VARIABLE not in os.environ and Path(models).is_dir():
            backend = replace(backend, perception=replace(backend.perception, host_options={"models": models}))
        self.backend = backend
        self._why_not = ""
        if import_callable(backend.decision.path) in (vlm, custom):
            path = response_cache or run_dir / EXCHANGES_NAME
            if path.is_file():
                decision = replace(backend.decision, host_options={"cache": str(path), "mode": "replay"})
                self.backend = replace(backend, decision=decision)
            elif not _answers_itself(backend):
                self._why_not = f"The model's answers were not stored: {path} not found."

    def budget(self, agent: str) -> int:
        """Return the number of rounds that an agent has in a stage."""
        return self.protocol.budget(make_agent(agent).sensors)

    def episode(
        self,
        agent: str,
        task_id: str,
        on_round: Callable[[int, int], None] = lambda _stage, _round: None,
        *,
        last_stage: int | None = None,
    ) -> Iterator[ReplayedStage]:
        """Yield the stages of an episode that have a record.

        Args:
            on_round: Called with the stage and the round, from 0, as they begin.
            last_stage: Last stage to yield; default all.

        Raises:
            InvalidArgumentError: The run has no record of this episode.
            StoreError: The run cannot be read.
            TaskError: The task cannot be read.
        """
        with RunStore(self._run_dir) as store, store.snapshot():
            stored = {record.stage: record for record in store.records(agent, task_id)}
            texts = dict(zip(stored, store.record_texts(agent, task_id), strict=True))
            stored = {k: record for k, record in stored.items() if last_stage is None or k <= last_stage}
            maps = {floor_plan.stage: floor_plan for floor_plan in store.floor_plans(task_id)}
        if not stored:
            raise InvalidArgumentError(
                f"{self._run_dir}: no record of task {task_id!r} by agent {agent!r}{_near(self._run_dir, task_id)}"
            )
        case = replace(
            self.backend.tasks.create(self._task_path(task_id)),
            opaque_id=opaque_task_id(self._secret, task_id),
        )
        for stage in self._stages(case, agent, stored, maps, on_round):
            yield replace(stage, differences=_differences(texts.get(stage.record.stage), stage))

    def _stages(
        self,
        case: EpisodeSpec,
        agent_name: str,
        stored: Mapping[int, StageRecord],
        maps: Mapping[int, FloorPlan],
        on_round: Callable[[int, int], None],
    ) -> Iterator[ReplayedStage]:
        lost = [stage for stage, record in stored.items() if _is_beyond_replay(record)]
        # Run again up to here.
        last = 0 if self._why_not else min([max(stored) + 1, *lost]) - 1
        fov_rad = 0.0
        if last > 0:
            with closing(self.backend.simulator.create()) as simulator:
                seed = agent_seed(self.seed, agent_name, case.task_id)
                agent = make_agent(agent_name, self.backend.decision.create(seed))
                losses = {stage: loss for stage in stored if (loss := _loss(stored[stage]))}
                recorder = Recorder(
                    agent,
                    on_round,
                    losses,
                    self._heading_px,
                    keeps_depth=self._keeps_depth,
                    tells_of_change=bool(self.backend.decision.options.get("tells_of_change")),
                )
                perception = self.backend.perception.create()
                episode = Episode(
                    case,
                    agent_name,
                    agent,
                    simulator,
                    perception,
                    self.protocol,
                    seed,
                    recorder,
                    perception_seed=perception_seed(self.seed, case.task_id),
                )
                for outcome in episode.run():
                    replayed = recorder.take(outcome, maps.get(outcome.record.stage))
                    fov_rad = replayed.fov_rad
                    yield replayed
                    if outcome.record.stage == last:
                        break
                    if _loss(outcome.record) or _begins_anew(stored.get(outcome.record.stage + 1)):
                        recorder.agent = make_agent(agent_name, self.backend.decision.create(seed))
                        episode.replace_agent(recorder.agent)
        for number, record in stored.items():
            if number > last:
                why_not = self._why_not or _why_not(record, number == last + 1)
                yield ReplayedStage(record, maps.get(number), _recorded_rounds(record), why_not, (), fov_rad)


def _answers_itself(backend: Backend) -> bool:
    """Return whether the user's own model answers the questions itself, so that its answers are not stored."""
    path = backend.decision.options.get("path")
    return path is not None and isinstance(load_custom_model(str(path), 0), DecisionModel)


def _loss(record: StageRecord) -> Loss | None:
    """Return the loss of the agent's process in a stage, if there was one."""
    error = record.error
    if record.state is not EndState.ERRORED or error is None or not error.kind.loses_memory:
        return None
    return Loss(len(record.trace), error.kind, error.message)


def _begins_anew(record: StageRecord | None) -> bool:
    """Return whether the agent's process was lost just before a stage."""
    return record is not None and record.memory_lost_at == record.stage


def _is_beyond_replay(record: StageRecord) -> bool:
    """Return whether more than the agent was lost: a stage that was not even begun, or the simulator."""
    if record.state is not EndState.ERRORED or record.error is None:
        return False
    return record.error.kind is ErrorKind.SIMULATOR_LOST or (
        _loss(record) is not None and record.effective_start is None
    )


def _why_not(record: StageRecord, is_first: bool) -> str:
    if is_first and record.error is not None:
        return f"It ended with the loss of a process ({record.error.kind.value}): {record.error.message}."
    return "A stage before it cannot be run again."


def _recorded_rounds(record: StageRecord) -> tuple[ReplayedRound, ...]:
    return tuple(ReplayedRound(entry, entry.pose, ()) for entry in record.trace)


def _differences(stored: str | None, stage: ReplayedStage) -> tuple[str, ...]:
    """Return where a replayed record differs from the stored one."""
    if stored is None or not stage.is_replayed:
        return ()
    return record_differences(stored, stage.record.model_dump_json(), "replayed")
