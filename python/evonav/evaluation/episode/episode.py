"""An episode: one agent through the stages of one task, by the paper's multi-stage protocol (Sec. C.1).

An agent's failure costs its stage: the same agent goes on with the next one, or, if its process was lost, a fresh agent
that remembers nothing. The records of later stages say so. A failure of anything else ends the episode.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from time import process_time

from evonav.agents.agent import Agent
from evonav.evaluation.episode.observer import LOSSES, EpisodeObserver
from evonav.evaluation.episode.oracle_baselines import OracleBaseline, as_oracle_baseline
from evonav.evaluation.episode.outcome import StageOutcome, as_not_run
from evonav.evaluation.episode.spec import EpisodeSpec
from evonav.evaluation.episode.stage import EpisodeContext, EpisodeState, Stage
from evonav.evaluation.hosting.agent import HostedAgent, LocalAgent
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.costs import LEVELS, Stopwatch
from evonav.evaluation.records.schema import ErrorKind, StageRecord
from evonav.perception import Perception
from evonav.world.pose import Pose
from evonav.world.simulator import Simulator


class Episode:
    """One agent's run through one task."""

    def __init__(
        self,
        case: EpisodeSpec,
        agent_name: str,
        agent: Agent | HostedAgent,
        simulator: Simulator,
        perception: Perception,
        protocol: ProtocolConfig,
        seed: int,
        observer: EpisodeObserver | None = None,
        *,
        perception_seed: int | None = None,
    ) -> None:
        self._case = case
        self._agent_name = agent_name
        self._parts = EpisodeContext(
            case,
            *_hosted(agent),
            simulator,
            perception,
            protocol,
            seed,
            seed if perception_seed is None else perception_seed,
            observer,
        )
        self._state = EpisodeState()
        self._told_costs: Mapping[str, float] = {}

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
                yield StageOutcome(as_not_run(record, failure.error, failure.stage), 0.0, 0.0)
                continue
            if is_lost:
                memory_lost_at, is_lost = stage, False
            record = record.model_copy(update={"failed_before": failed, "memory_lost_at": memory_lost_at})
            stopwatch = Stopwatch(self._cpu_s)
            run = Stage(self._parts, self._state, record, pose, stopwatch)
            record = run.run()
            costs = stopwatch.costs(self._new_costs(run.failure))
            wall_s, cpu_s = costs.wall_s or 0.0, costs.cpu_s or 0.0
            yield StageOutcome(record, wall_s, cpu_s, run.traceback, costs)
            if run.failure is None:
                pose = self._end_pose(stage)
            elif run.failure.is_agents:
                failed = (*failed, stage)
                pose = self._end_pose(stage)
                is_lost = run.failure in LOSSES
                self._state = EpisodeState() if is_lost else self._state
            else:
                failure = record

    def _end_pose(self, stage: int) -> Pose:
        """Where a stage ends: where the agent stands, or where it would have been taken had it not failed."""
        pose, forced = self._parts.simulator.pose, self._case.stages[stage - 1].guided
        return pose if forced is None else replace(forced.end, y_m=pose.y_m, horizon_rad=pose.horizon_rad)

    def _new_costs(self, failure: ErrorKind | None) -> Mapping[str, float]:
        """What the agent's decision model has cost in the stage; empty where that is not known."""
        if failure in LOSSES:
            self._told_costs = {}
            return {}
        told, before = self._parts.agent.costs(), self._told_costs
        self._told_costs = told
        return {name: value if name in LEVELS else value - before.get(name, 0) for name, value in told.items()}

    def replace_agent(self, agent: Agent) -> None:
        """Another agent from the next stage on, as after the loss of a process; for replays in one process."""
        hosted, baseline = _hosted(agent)
        self._parts = replace(self._parts, agent=hosted, baseline=baseline)

    def _cpu_s(self) -> float:
        """Of this process, and of the agent's where it has one."""
        return process_time() + self._parts.agent.cpu_s


def _hosted(agent: Agent | HostedAgent) -> tuple[HostedAgent, OracleBaseline | None]:
    """Return the agent as a stage asks it, and itself if it is an oracle baseline."""
    if isinstance(agent, HostedAgent):
        return agent, None
    return LocalAgent(agent), as_oracle_baseline(agent)
