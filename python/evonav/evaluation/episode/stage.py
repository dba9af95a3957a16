"""Run one stage of an episode: start, rounds, score."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from evonav.agents.agent import AgentAction, EntryBelief, NavigateTo, SensorConfig, Stop
from evonav.errors import InvalidArgumentError
from evonav.evaluation.episode import motion
from evonav.evaluation.episode.observer import AttributedErrors, EpisodeObserver, StageFailedError, traceback_of
from evonav.evaluation.episode.oracle_baseline import OracleBaseline, Sighting
from evonav.evaluation.episode.outcome import as_errored
from evonav.evaluation.episode.progress import StageProgress
from evonav.evaluation.episode.sensors import Sensors, map_frame
from evonav.evaluation.episode.spec import EpisodeSpec, GuidedWalk
from evonav.evaluation.episode.stage_house import StageHouse
from evonav.evaluation.episode.staleness import StalenessTracker, TrackedState, entry_record
from evonav.evaluation.hosting.agent import HostedAgent
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.costs import Stopwatch
from evonav.evaluation.records.schema import BeliefRecord, EndState, ErrorKind, MemoryRecord, RoundRecord, StageRecord
from evonav.perception import Perception, StageScene
from evonav.points import Point2
from evonav.sensors.observation import Observation
from evonav.tasks.public import TaskInfo
from evonav.world.pose import Pose
from evonav.world.simulator import Simulator


@dataclass(frozen=True, slots=True)
class EpisodeContext:
    """The parts that stay the same in all stages of an episode."""

    spec: EpisodeSpec
    agent: HostedAgent
    baseline: OracleBaseline | None
    """The agent itself, if it is an oracle baseline."""
    simulator: Simulator
    perception: Perception
    protocol: ProtocolConfig
    seed: int
    """Seed of the agent's random choices."""
    perception_seed: int
    observer: EpisodeObserver | None


@dataclass(slots=True)
class EpisodeState:
    """The state that lasts from one stage to the next."""

    has_begun: bool = False
    """True once the agent has received the task."""
    tracked: TrackedState = field(default_factory=TrackedState)


class Stage:
    """One stage of an episode: start, rounds, score."""

    def __init__(
        self, context: EpisodeContext, state: EpisodeState, record: StageRecord, requested: Pose, stopwatch: Stopwatch
    ) -> None:
        """Prepare a stage, which updates the state; the agent should start at the requested pose."""
        self._state = state
        self._spec = context.spec
        self._agent = context.agent
        self._baseline = context.baseline
        self._simulator = context.simulator
        self._perception = context.perception
        self._protocol = context.protocol
        self._seed = context.seed
        self._perception_seed = context.perception_seed
        self._observer = context.observer
        self._stage = self._spec.stages[record.stage - 1]
        self._record = record
        self._requested = requested
        self._sensor_config = SensorConfig()
        self._house = StageHouse(self._spec, record.stage, self._simulator, self._protocol)
        self._stopwatch = stopwatch
        self._staleness = StalenessTracker((), "", (), state.tracked, 1)
        self._memory_at_start: MemoryRecord | None = None
        self._belief_at_start: BeliefRecord | None = None
        self._beliefs: Sequence[EntryBelief] | None = None
        """The agent's entries after the last round, if they were read."""
        self._trace: list[RoundRecord] = []
        self.failure: ErrorKind | None = None
        """Cause of the failure, if the stage failed."""
        self.traceback = ""

    def run(self) -> StageRecord:
        """Run the stage and return its record; if it fails, `failure` and `traceback` hold the cause."""
        try:
            with AttributedErrors(ErrorKind.HARNESS):
                self._start()
                # The agent is told the goal after this, or the time until its first round would tell of the distance.
                with AttributedErrors(ErrorKind.SIMULATION), self._stopwatch.timing("simulation"):
                    reference_m = [] if self._stage.guided is not None else self._house.path_to_target_m()
                self._instruct()
                if self._stage.guided is not None:
                    return self._guided(self._stage.guided)
                progress = self._begin(self._protocol.budget(self._sensor_config), reference_m)
                stop_reason = self._rounds(progress, lambda action: self._house.carry_out(action, self._sensor_config))
                return self._measured(progress, reference_m, stop_reason)
        except StageFailedError as failure:
            self.failure = failure.kind
            self.traceback = traceback_of(failure)
            self._staleness.close(())
            return as_errored(self._with_trace(self._record), failure.kind, str(failure))

    def _start(self) -> None:
        """Load the stage's house and place the agent."""
        stage = self._record.stage
        with AttributedErrors(ErrorKind.SIMULATION), self._stopwatch.timing("simulation"):
            start = self._house.load(self._requested)
            is_snapped = math.dist((start.x_m, start.z_m), (self._requested.x_m, self._requested.z_m)) > 1e-6
        self._staleness = StalenessTracker(
            self._simulator.objects,
            self._stage.target.object_id,
            self._stage.transition.relocations,
            self._state.tracked,
            self._protocol.min_visible_px,
        )
        self._state.tracked.pending = () if self._house.during is None else self._house.during.left
        is_in_room = self._house.is_in_room(self._requested, self._record.transition.room_id)
        self._record = self._record.model_copy(
            update={
                "requested_start": self._requested,
                "effective_start": start,
                "is_snapped": is_snapped,
                "transition": self._record.transition.model_copy(update={"is_agent_in_room": is_in_room}),
            }
        )
        if self._observer is not None:
            self._observer.stage_begins(stage, self._simulator)

    def _instruct(self) -> None:
        """Send the agent the goal, and read its memory as the stage begins."""
        with AttributedErrors(ErrorKind.AGENT):
            with self._stopwatch.timing("agent"):
                self._tell_goal()
            beliefs = self._entries()
            if beliefs and self._baseline is not None:
                self._baseline.reveal_stale(self._staleness.stale_ids(beliefs))
                beliefs = self._entries()
        self._memory_at_start = None if beliefs is None else self._staleness.begin(beliefs)
        self._belief_at_start = self._staleness.presence(beliefs or ())
        self._record = self._record.model_copy(update={"sensing": self._sensor_config})

    def _tell_goal(self) -> None:
        """Tells the agent of the task, if it does not know, and of the stage. Its sensors are held for the stage."""
        if not self._state.has_begun:
            self._sensor_config = self._granted()
            self._agent.begin_task(
                TaskInfo(
                    task_id=self._spec.opaque_id,
                    num_stages=len(self._spec.stages),
                    max_rounds=self._protocol.budget(self._sensor_config),
                    map_frame=map_frame(self._simulator.occupancy()),
                    seed=self._seed,
                )
            )
            self._state.has_begun = True
        self._agent.begin_stage(self._stage.public)
        self._sensor_config = self._granted()
        if self._baseline is not None:
            self._baseline.reveal_target(self._stage.target.position_m)

    def _granted(self) -> SensorConfig:
        """Return the agent's sensor settings, checked against the protocol."""
        sensors = self._agent.sensors
        self._protocol.check(sensors)
        return sensors

    def _begin(self, budget: int, reference_m: Sequence[Point2]) -> StageProgress:
        """Count steps from here; without a reference path, the stage has no score."""
        pose = self._simulator.pose
        x_m, _, z_m = self._stage.target.position_m
        return StageProgress(
            target_m=(x_m, z_m),
            start_m=(pose.x_m, pose.z_m),
            reference_length_m=motion.polyline_length_m(reference_m) if reference_m else None,
            budget=budget,
            success_radius_m=self._protocol.success_radius_m,
        )

    def _rounds(
        self, progress: StageProgress, carry_out: Callable[[AgentAction], motion.Motion], *, is_guided: bool = False
    ) -> str | None:
        """Run decision rounds until the agent stops (return why) or the budget ends (return `None`)."""
        sensors = self._sensors()
        last = motion.Motion((), is_success=True)
        while not progress.is_over:
            number = progress.num_steps
            if not is_guided and self._house.is_change_due(number, self._sensor_config):
                self._change_house(number, progress, sensors)
            self._staleness.begin_round(number)
            with AttributedErrors(ErrorKind.SIMULATION):
                observation = sensors.observe(
                    is_first=number == 0,
                    is_action_success=last.is_success,
                    has_arrived=last.has_arrived,
                    num_rounds_left=progress.budget - number,
                    is_guided=is_guided,
                )
            self._show(observation)
            del observation  # an agent in a process of its own has a copy, and may think for long
            with AttributedErrors(ErrorKind.AGENT), self._stopwatch.timing("agent"):
                action = self._agent.act()
                if isinstance(action, NavigateTo) and self._sensor_config.motion == "actions":
                    message = "NavigateTo: an agent whose `sensors.motion` is `actions` answers Move or Stop"
                    raise InvalidArgumentError(message)
            with AttributedErrors(ErrorKind.SIMULATION), self._stopwatch.timing("simulation"):
                last = carry_out(action)
            is_stop = isinstance(action, Stop) and not is_guided
            progress.advance(last.length_m, is_stop=is_stop)
            self._end_round(number, sensors.pose, action, last)
            if is_guided and not last.is_success:
                message = f"the reference trajectory is blocked at {last.path_m[-1]}"
                raise StageFailedError(ErrorKind.SIMULATION, message)
            if isinstance(action, Stop) and is_stop:
                return action.reason
        return None

    def _guided(self, walk: GuidedWalk) -> StageRecord:
        """Follow the reference path; the agent's actions are recorded but ignored."""
        is_stepwise = self._sensor_config.motion == "actions"
        travel_m = self._protocol.waypoint_m if is_stepwise else self._protocol.max_travel_m
        legs = motion.legs(walk.path_m, travel_m)
        progress = self._begin(len(legs) + 1, ())

        def follow(_: AgentAction) -> motion.Motion:
            """Walk the next leg; the agent observes once more at the end."""
            number = progress.num_steps
            if number == len(legs):
                return motion.stay(self._simulator)
            is_last = number + 1 == len(legs)
            return motion.walk(self._simulator, legs[number], walk.end.yaw_rad if is_last else None)

        self._rounds(progress, follow, is_guided=True)
        end = self._simulator.pose
        return self._with_memory(self._with_trace(self._record)).model_copy(
            update={"state": EndState.GUIDED, "terminal": end, "path_length_m": progress.path_length_m}
        )

    def _change_house(self, number: int, progress: StageProgress, sensors: Sensors) -> None:
        """Change the house during the stage, before a round's views; the agent is not told."""
        with AttributedErrors(ErrorKind.SIMULATION):
            with self._stopwatch.timing("simulation"):
                during = self._house.change(number, progress.path_length_m)
            sensors.change_scene(self._scene())
        x_m, _, z_m = self._house.target_m
        progress.moved_target_m = (x_m, z_m)
        self._staleness.change_house(self._simulator.objects, during.done)
        self._state.tracked.pending = during.left
        self._record = self._record.model_copy(update={"during": during})
        if self._baseline is not None:
            self._baseline.reveal_target(self._house.target_m)
        if self._observer is not None:
            self._observer.house_changes(self._simulator)

    def _scene(self) -> StageScene:
        """Return the stage as the perception may know it."""
        task_id, agent = self._spec.task_id, self._record.agent
        return StageScene(task_id, self._stage.public, agent, self._perception_seed, self._simulator.objects)

    def _sensors(self) -> Sensors:
        with AttributedErrors(ErrorKind.SIMULATION):
            return Sensors(
                self._simulator, self._perception, self._sensor_config, self._scene(), self._staleness, self._stopwatch
            )

    def _show(self, observation: Observation) -> None:
        """Give the agent the observation of a round."""
        if self._observer is not None:
            self._observer.round_begins(observation)
        with AttributedErrors(ErrorKind.AGENT), self._stopwatch.timing("agent"):
            if self._baseline is not None:
                self._baseline.reveal_sighting(
                    Sighting(self._staleness.is_target_visible, self._staleness.is_target_seen)
                )
            self._agent.look(observation, wants_entries=self._wants_entries)

    def _end_round(self, number: int, pose: Pose, action: AgentAction, done: motion.Motion) -> None:
        self._trace.append(self._round_record(number, pose, action, done))
        self._beliefs = None
        if self._wants_entries:
            with AttributedErrors(ErrorKind.AGENT):
                self._beliefs = self._entries()
            self._staleness.take_entries(self._beliefs or ())
        if self._observer is not None:
            self._observer.round_ends(self._trace[-1])

    @property
    def _wants_entries(self) -> bool:
        """True if the agent's entries are judged after the round."""
        return self._memory_at_start is not None and self._staleness.wants_entries

    def _round_record(self, number: int, pose: Pose, action: AgentAction, done: motion.Motion) -> RoundRecord:
        with AttributedErrors(ErrorKind.AGENT):
            diagnostics, bodies = self._agent.diagnostics(), self._staleness.bodies
            chosen = diagnostics.chosen_entry
            if number == 0 and diagnostics.places is not None:
                belief = self._belief_at_start or BeliefRecord()
                self._belief_at_start = belief.model_copy(update={"places": diagnostics.places})
            return RoundRecord(
                round=number,
                pose=pose,
                action=action,
                path_m=done.path_m,
                is_action_success=done.is_success,
                is_target_visible=self._staleness.is_target_visible,
                choice=diagnostics.choice,
                chosen_entry=None if chosen is None else entry_record(chosen, bodies),
                num_entries=diagnostics.num_entries,
                num_frontiers=diagnostics.num_frontiers,
                counters=dict(diagnostics.counters),
                details=dict(diagnostics.details),
            )

    def _measured(self, progress: StageProgress, reference_m: Sequence[Point2], stop_reason: str | None) -> StageRecord:
        end, radius_m = self._simulator.pose, progress.success_radius_m
        score = progress.score((end.x_m, end.z_m))
        with AttributedErrors(ErrorKind.SIMULATION), self._stopwatch.timing("simulation"):
            left_m = self._house.path_to_target_m()
        geodesic_m = motion.polyline_length_m(left_m) if left_m else None
        record = self._with_memory(self._with_trace(self._record)).model_copy(
            update={
                "state": EndState.SUCCESS if score.is_success else EndState.FAILURE,
                "terminal": end,
                "has_stopped": stop_reason is not None,
                "stop_reason": stop_reason or "",
                "start_distance_m": score.start_distance_m,
                "terminal_distance_m": score.terminal_distance_m,
                "terminal_box_distance_m": self._staleness.target_box_distance_m((end.x_m, end.z_m)),
                "terminal_geodesic_m": geodesic_m,
                "is_geodesic_success": geodesic_m is not None and geodesic_m < radius_m,
                "path_length_m": progress.path_length_m,
            }
        )
        if not reference_m:
            # The agent's memory and pose are sound, so the episode goes on; only this stage has no measure.
            return as_errored(record, ErrorKind.REFERENCE, "no path from the effective start to the target")
        return record.model_copy(
            update={
                "reference_length_m": progress.reference_length_m,
                "reference_ring_m": motion.length_outside_m(list(reference_m), progress.target_m, radius_m),
                "spl": score.spl,
                "soft_spl": score.soft_spl,
            }
        )

    def _with_memory(self, record: StageRecord) -> StageRecord:
        """Return the record with the agent's memory at the end, compared with the house."""
        with AttributedErrors(ErrorKind.AGENT):
            beliefs = self._entries() if self._beliefs is None else self._beliefs
        if beliefs is None:
            self._staleness.close(())
            return record
        memory, num_forgotten = self._staleness.end(beliefs)
        return record.model_copy(
            update={
                "entries": tuple(entry_record(belief, self._staleness.bodies) for belief in beliefs),
                "memory_at_start": self._memory_at_start,
                "memory_at_end": memory,
                "num_forgotten": num_forgotten,
                "stale_entries": self._staleness.stale_entries(),
                "moved_objects": self._staleness.moved_objects(),
            }
        )

    def _with_trace(self, record: StageRecord) -> StageRecord:
        return record.model_copy(
            update={
                "num_rounds": len(self._trace),
                "num_target_visible_rounds": sum(entry.is_target_visible for entry in self._trace),
                "belief_at_start": self._belief_at_start,
                "trace": tuple(self._trace),
            }
        )

    def _entries(self) -> Sequence[EntryBelief] | None:
        """Return the agent's object memory; None if it does not explain itself."""
        with self._stopwatch.timing("agent"):
            return self._agent.entries()
