"""An episode: one agent through the stages of one task, by the paper's multi-stage protocol (Sec. C.1).

An agent's failure costs its stage: the same agent goes on with the next one, or, if its process was lost, a fresh agent
that remembers nothing. The records of later stages say so. A failure of anything else ends the episode.
"""

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Protocol, runtime_checkable

from evonav.agents import wire
from evonav.agents.agent import (
    Agent,
    AgentAction,
    EntryBelief,
    ExplainingAgent,
    Move,
    NavigateTo,
    RoundDiagnostics,
    Sensing,
    Stop,
)
from evonav.errors import DecisionError, SimulationError, SimulatorLostError
from evonav.evaluation import motion
from evonav.evaluation.cases import room_at, stage_map
from evonav.evaluation.metrics import stage_soft_spl, stage_spl
from evonav.evaluation.privileged import Sighting, privileges_of
from evonav.evaluation.protocol import (
    AgentFailedError,
    EpisodeCase,
    ForcedWalk,
    ProtocolConfig,
    StageOutcome,
    as_errored,
    as_not_run,
)
from evonav.evaluation.record_parts import action_record, entry_record, pose_record, sensing_record
from evonav.evaluation.records import (
    EndState,
    EntryRecord,
    ErrorKind,
    RoundRecord,
    StageMap,
    StageRecord,
)
from evonav.evaluation.sensing import Perception, Sensed, Sensors, map_frame
from evonav.sensors.observation import Observation
from evonav.tasks.public import TaskInfo
from evonav.world.pose import Pose
from evonav.world.simulator import SceneObject, Simulator


class EpisodeObserver(Protocol):
    """Looks on as an episode runs (`evonav.evaluation.trace`); nothing of it reaches agent or record.

    What it raises as `AgentFailedError` fails the stage as if the agent had.
    """

    def stage_begins(self, stage: int, simulator: Simulator) -> None:
        """A stage's house is loaded; the agent was not told yet."""
        ...

    def round_begins(self, observation: Observation) -> None:
        """What the agent is about to be given."""
        ...

    def round_ends(self, record: RoundRecord) -> None:
        """The agent has acted, and its action was carried out."""
        ...


LOSSES = (ErrorKind.CRASH, ErrorKind.TIMEOUT)
"""Failures that end the agent's process, and its memory with it."""


@runtime_checkable
class HasOwnProcess(Protocol):
    """An agent in a process of its own: what it says has crossed the border as JSON already."""

    @property
    def cpu_s(self) -> float:
        """CPU time that its processes have used."""
        ...


class _StageError(Exception):
    """A stage that cannot go on; carries whose fault it is."""

    def __init__(self, kind: ErrorKind, message: str) -> None:
        super().__init__(message)
        self.kind = kind


@contextmanager
def _blame(kind: ErrorKind) -> Iterator[None]:
    """Turns what is raised inside into a stage failure of `kind`; errors that name their own cause keep it."""
    try:
        yield
    except _StageError:
        raise
    except AgentFailedError as error:
        raise _StageError(error.kind, str(error)) from error
    except DecisionError as error:
        raise _StageError(ErrorKind.DECISION, wire.clean(str(error))) from error
    except Exception as error:
        if kind is ErrorKind.AGENT:
            raise _StageError(kind, wire.describe(error)) from error
        if isinstance(error, SimulationError):
            is_lost = isinstance(error, SimulatorLostError)
            kind = ErrorKind.SIMULATOR_LOST if is_lost else ErrorKind.SIMULATION
            raise _StageError(kind, str(error)) from error
        raise _StageError(kind, f"{type(error).__name__}: {error}") from error


def _traceback_of(failure: _StageError) -> str:
    cause = failure.__cause__ or failure
    return (isinstance(cause, AgentFailedError) and cause.traceback) or wire.traceback_of(cause)


class Episode:
    """One agent's run through one task."""

    def __init__(
        self,
        case: EpisodeCase,
        agent_name: str,
        agent: Agent,
        simulator: Simulator,
        perception: Perception,
        protocol: ProtocolConfig,
        seed: int,
        observer: EpisodeObserver | None = None,
    ) -> None:
        self._observer = observer
        self._case = case
        self._agent_name = agent_name
        self._agent = agent
        self._simulator = simulator
        self._perception = perception
        self._protocol = protocol
        self._seed = seed
        self._has_begun = False
        """The agent knows the task."""

    def run(self) -> Iterator[StageOutcome]:
        """Runs the stages in order.

        Yields:
            The outcome of every stage as it ends. After an error that is not the agent's, the later stages are not
            run: where the agent would have stood, and what it would have seen, is not known.
        """
        pose = self._case.start
        failure: StageRecord | None = None
        failed: tuple[int, ...] = ()
        memory_lost_at: int | None = None
        is_lost = False
        for stage in range(1, len(self._case.stages) + 1):
            record = self._case.blank_record(self._agent_name, stage)
            if failure is not None and failure.error is not None:
                yield StageOutcome(as_not_run(record, failure.error, failure.stage), None, 0.0, 0.0)
                continue
            if is_lost:
                memory_lost_at, is_lost = stage, False
            record = record.model_copy(update={"failed_before": failed, "memory_lost_at": memory_lost_at})
            wall_s, cpu_s = time.perf_counter(), self._cpu_s()
            run = _StageRun(self, record, pose)
            record = run.run()
            wall_s, cpu_s = time.perf_counter() - wall_s, self._cpu_s() - cpu_s
            yield StageOutcome(record, run.plan, wall_s, cpu_s, run.traceback)
            if run.failure is None:
                pose = self._end_pose(stage)
            elif run.failure.is_agents:
                failed = (*failed, stage)
                pose = self._end_pose(stage)
                is_lost = run.failure in LOSSES
                self._has_begun = self._has_begun and not is_lost
            else:
                failure = record

    def _end_pose(self, stage: int) -> Pose:
        """Where a stage ends: where the agent stands, or where it would have been taken had it not failed."""
        pose, forced = self._simulator.pose, self._case.stages[stage - 1].forced
        return pose if forced is None else replace(forced.end, y_m=pose.y_m, horizon_rad=pose.horizon_rad)

    def replace_agent(self, agent: Agent) -> None:
        """Another agent from the next stage on, as after the loss of a process; for replays in one process."""
        self._agent = agent

    def _cpu_s(self) -> float:
        """Of this process, and of the agent's where it has one."""
        return time.process_time() + (self._agent.cpu_s if isinstance(self._agent, HasOwnProcess) else 0.0)


class _StageRun:
    """One stage of an episode: start, rounds, measures."""

    def __init__(self, episode: Episode, record: StageRecord, requested: Pose) -> None:
        self._episode = episode
        self._case = episode._case
        self._agent = episode._agent
        self._simulator = episode._simulator
        self._perception = episode._perception
        self._protocol = episode._protocol
        self._seed = episode._seed
        self._observer = episode._observer
        self._stage = self._case.stages[record.stage - 1]
        self._record = record
        self._requested = requested
        self._sensing = Sensing()
        self._planner = motion.Planner(self._simulator)
        self._bodies: dict[str, list[SceneObject]] = {}
        self._trace: list[RoundRecord] = []
        self._length_m = 0.0
        self.plan: StageMap | None = None
        self.failure: ErrorKind | None = None
        """Why the stage could not be finished."""
        self.traceback = ""

    def run(self) -> StageRecord:
        try:
            with _blame(ErrorKind.HARNESS):
                self._start()
                if self._stage.forced is not None:
                    return self._forced(self._stage.forced)
                with _blame(ErrorKind.SIMULATION):
                    reference_length_m = self._reference_length_m()
                stop_reason = self._rounds()
                return self._measured(reference_length_m, stop_reason)
        except _StageError as failure:
            self.failure = failure.kind
            self.traceback = _traceback_of(failure)
            return as_errored(self._with_trace(self._record), failure.kind, str(failure))

    def _start(self) -> None:
        """Loads the stage's house, puts the agent where it ended, and tells it the goal."""
        stage = self._record.stage
        with _blame(ErrorKind.SIMULATION):
            start = self._simulator.reset(self._stage.house_json, self._requested)
            is_snapped = math.dist((start.x_m, start.z_m), (self._requested.x_m, self._requested.z_m)) > 1e-6
        for body in self._simulator.objects:
            self._bodies.setdefault(body.category, []).append(body)
        self.plan = stage_map(self._case, stage, self._simulator.objects)
        room_id = room_at(self.plan, (self._requested.x_m, self._requested.z_m))
        evolved_room_id = self._record.transition.room_id
        self._record = self._record.model_copy(
            update={
                "requested_start": pose_record(self._requested),
                "effective_start": pose_record(start),
                "is_snapped": is_snapped,
                "transition": self._record.transition.model_copy(
                    update={"is_agent_in_room": evolved_room_id is not None and room_id == evolved_room_id}
                ),
            }
        )
        if self._observer is not None:
            self._observer.stage_begins(stage, self._simulator)
        with _blame(ErrorKind.AGENT):
            self._tell_goal()
        self._record = self._record.model_copy(update={"sensing": sensing_record(self._sensing)})

    def _tell_goal(self) -> None:
        """Tells the agent of the task, if it does not know, and of the stage. Its sensing is held for the stage."""
        self._sensing = self._granted()
        if not self._episode._has_begun:
            self._agent.begin_task(
                TaskInfo(
                    task_id=self._case.task_id,
                    num_stages=len(self._case.stages),
                    max_rounds=self._protocol.budget(self._sensing),
                    map_frame=map_frame(self._simulator.occupancy()),
                    seed=self._seed,
                )
            )
            self._episode._has_begun = True
        self._agent.begin_stage(self._stage.public)
        self._sensing = self._granted()
        if (privileged := privileges_of(self._agent)) is not None:
            privileged.reveal_target(self._stage.target.position_m)

    def _granted(self) -> Sensing:
        """What the agent asks of its sensors, within the protocol."""
        sensing = wire.sensing_of(wire.read_json(wire.sensing_json(self._agent.sensing).encode()))
        self._protocol.check(sensing)
        return sensing

    def _reference_length_m(self) -> float | None:
        """L*: the planner's path from the effective start to the target, or `None` when there is none."""
        x_m, _, z_m = self._stage.target.position_m
        path_m = self._planner.path_m((x_m, z_m))
        return motion.polyline_length_m(path_m) if path_m else None

    def _rounds(self) -> str | None:
        """Decision rounds until the agent stops (returns why) or the budget ends (returns `None`)."""
        sensors = self._sensors()
        last = motion.Motion((), is_success=True)
        budget = self._protocol.budget(self._sensing)
        for number in range(budget):
            with _blame(ErrorKind.SIMULATION):
                sensed = sensors.observe(
                    is_first=number == 0,
                    is_action_success=last.is_success,
                    has_arrived=last.has_arrived,
                    num_rounds_left=budget - number,
                )
            action = self._answer(sensed)
            with _blame(ErrorKind.SIMULATION):
                last = self._carry_out(action)
            self._end_round(number, sensed, action, last)
            if isinstance(action, Stop):
                return action.reason
        return None

    def _forced(self, forced: ForcedWalk) -> StageRecord:
        """Walks the reference trajectory; the agent is asked in every round as in any stage, and not heeded."""
        sensors = self._sensors()
        is_stepwise = self._sensing.motion == "actions"
        travel_m = self._protocol.waypoint_m if is_stepwise else self._protocol.max_travel_m
        legs = motion.legs(forced.path_m, travel_m)
        for number in range(len(legs) + 1):
            with _blame(ErrorKind.SIMULATION):
                sensed = sensors.observe(is_first=number == 0, num_rounds_left=len(legs) + 1 - number, is_guided=True)
            action = self._answer(sensed)
            pose = self._simulator.pose
            done = motion.Motion(((pose.x_m, pose.z_m),), is_success=True)
            if number < len(legs):
                is_last = number + 1 == len(legs)
                with _blame(ErrorKind.SIMULATION):
                    done = motion.walk(self._simulator, legs[number], forced.end.yaw_rad if is_last else None)
            self._end_round(number, sensed, action, done)
            if not done.is_success:
                raise _StageError(ErrorKind.SIMULATION, f"the reference trajectory is blocked at {legs[number][-1]}")
        end = self._simulator.pose
        return self._with_trace(self._record).model_copy(
            update={
                "state": EndState.FORCED,
                "terminal": pose_record(end),
                "path_length_m": self._length_m,
                "entries": self._entries(),
            }
        )

    def _sensors(self) -> Sensors:
        with _blame(ErrorKind.SIMULATION):
            return Sensors(
                self._simulator,
                self._perception,
                self._sensing,
                self._stage.target.object_id,
                self._protocol.min_visible_px,
            )

    def _answer(self, sensed: Sensed) -> AgentAction:
        """What the agent answers to what it is given."""
        if self._observer is not None:
            self._observer.round_begins(sensed.observation)
        with _blame(ErrorKind.AGENT):
            if (privileged := privileges_of(self._agent)) is not None:
                privileged.reveal_sighting(Sighting(sensed.is_target_visible))
            return wire.checked_action(self._agent.act(sensed.observation), self._sensing)

    def _end_round(self, number: int, sensed: Sensed, action: AgentAction, done: motion.Motion) -> None:
        self._length_m += done.length_m
        self._trace.append(self._round_record(number, sensed, action, done))
        if self._observer is not None:
            self._observer.round_ends(self._trace[-1])

    def _carry_out(self, action: AgentAction) -> motion.Motion:
        if isinstance(action, NavigateTo):
            return motion.navigate(
                self._simulator,
                self._planner,
                action,
                spacing_m=self._protocol.waypoint_m,
                max_travel_m=self._sensing.max_travel_m,
            )
        if isinstance(action, Move):
            return motion.move(self._simulator, action)
        pose = self._simulator.pose
        return motion.Motion(((pose.x_m, pose.z_m),), is_success=True)

    def _round_record(self, number: int, sensed: Sensed, action: AgentAction, done: motion.Motion) -> RoundRecord:
        with _blame(ErrorKind.AGENT):
            told = self._told()
            return RoundRecord(
                round=number,
                pose=pose_record(sensed.observation.pose),
                action=action_record(action),
                path_m=done.path_m,
                is_action_success=done.is_success,
                is_target_visible=sensed.is_target_visible,
                choice=told.choice,
                chosen_entry=None if told.chosen_entry is None else self._entry_record(told.chosen_entry),
                num_entries=told.num_entries,
                num_frontiers=told.num_frontiers,
                counters=dict(told.counters),
                details=dict(told.details),
            )

    def _told(self) -> RoundDiagnostics:
        """The round in the agent's words, as JSON has them whatever process it is in."""
        if not isinstance(self._agent, ExplainingAgent):
            return RoundDiagnostics()
        told = self._agent.diagnostics()
        if isinstance(self._agent, HasOwnProcess):
            return told
        return wire.diagnostics_of(wire.read_json(wire.diagnostics_json(told).encode()))

    def _measured(self, reference_length_m: float | None, stop_reason: str | None) -> StageRecord:
        start, end = self._record.effective_start, self._simulator.pose
        assert start is not None  # set by _start
        x_m, _, z_m = self._stage.target.position_m
        start_distance_m = math.dist((start.x_m, start.z_m), (x_m, z_m))
        distance_m = math.dist((end.x_m, end.z_m), (x_m, z_m))
        is_success = distance_m < self._protocol.success_radius_m
        record = self._with_trace(self._record).model_copy(
            update={
                "state": EndState.SUCCESS if is_success else EndState.FAILURE,
                "terminal": pose_record(end),
                "has_stopped": stop_reason is not None,
                "stop_reason": stop_reason or "",
                "start_distance_m": start_distance_m,
                "terminal_distance_m": distance_m,
                "path_length_m": self._length_m,
                "reference_length_m": reference_length_m,
                "entries": self._entries(),
            }
        )
        if reference_length_m is None:
            # The agent's memory and pose are sound, so the episode goes on; only this stage has no measure.
            return as_errored(record, ErrorKind.REFERENCE, "no path from the effective start to the target")
        return record.model_copy(
            update={
                "spl": stage_spl(is_success, self._length_m, reference_length_m),
                "soft_spl": stage_soft_spl(start_distance_m, distance_m, self._length_m, reference_length_m),
            }
        )

    def _with_trace(self, record: StageRecord) -> StageRecord:
        return record.model_copy(
            update={
                "num_rounds": len(self._trace),
                "num_target_visible_rounds": sum(entry.is_target_visible for entry in self._trace),
                "trace": tuple(self._trace),
            }
        )

    def _entries(self) -> tuple[EntryRecord, ...]:
        if not isinstance(self._agent, ExplainingAgent):
            return ()
        with _blame(ErrorKind.AGENT):
            entries = self._agent.entries()
            if not isinstance(self._agent, HasOwnProcess):
                entries = wire.entries_of(wire.read_json(wire.entries_json(entries).encode()))
            return tuple(self._entry_record(belief) for belief in entries)

    def _entry_record(self, belief: EntryBelief) -> EntryRecord:
        return entry_record(belief, self._bodies)
