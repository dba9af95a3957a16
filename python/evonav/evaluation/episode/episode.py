"""Run an episode: one agent through the stages of one task, by the paper's multi-stage protocol (Sec. C.1).

An agent's failure costs its stage: the same agent goes on with the next one, or, if its process was lost, a fresh agent
that remembers nothing. The records of later stages say so. A failure of anything else ends the episode.
"""

from collections.abc import Callable, Generator, Mapping
from dataclasses import replace
from time import process_time

from evonav.agents.agent import Agent
from evonav.evaluation.episode.observer import EpisodeObserver
from evonav.evaluation.episode.oracle_baseline import OracleBaseline
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
        spec: EpisodeSpec,
        agent_name: str,
        agent: Agent | HostedAgent,
        simulator: Simulator,
        perception: Perception,
        protocol: ProtocolConfig,
        seed: int,
        observer: EpisodeObserver | None = None,
        *,
        perception_seed: int | None = None,
        own_cpu_s: Callable[[], float] = process_time,
    ) -> None:
        self._spec = spec
        self._own_cpu_s = own_cpu_s
        self._agent_name = agent_name
        self._context = EpisodeContext(
            spec,
            *_hosted(agent),
            simulator,
            perception,
            protocol,
            seed,
            seed if perception_seed is None else perception_seed,
            observer,
        )
        self._state = EpisodeState()
        self._last_costs: Mapping[str, float] = {}
        self._is_replaced = False

    def run(self) -> Generator[StageOutcome]:
        """Run the stages in order.

        Yields:
            The outcome of every stage as it ends. After an error that is not the agent's, the later stages are not
            run, since the agent's pose and observations are unknown.
        """
        pose = self._spec.start
        failure: StageRecord | None = None
        failed: tuple[int, ...] = ()
        memory_lost_at: int | None = None
        is_lost = False
        for stage in range(1, len(self._spec.stages) + 1):
            record = self._spec.blank_record(self._agent_name, stage)
            if failure is not None and failure.error is not None:
                yield StageOutcome(as_not_run(record, failure.error, failure.stage), 0.0, 0.0)
                continue
            if is_lost:
                memory_lost_at, is_lost = stage, False
            record = record.model_copy(update={"failed_before": failed, "memory_lost_at": memory_lost_at})
            stopwatch = Stopwatch(self._cpu_s)
            run = Stage(self._context, self._state, record, pose, stopwatch)
            record = run.run()
            costs = stopwatch.costs(self._new_costs(run.failure))
            wall_s, cpu_s = costs.wall_s or 0.0, costs.cpu_s or 0.0
            yield StageOutcome(record, wall_s, cpu_s, run.traceback, costs)
            if run.failure is not None and not run.failure.is_agents:
                failure = record
                continue
            is_lost = self._is_replaced
            if run.failure is not None:
                failed = (*failed, stage)
                is_lost = is_lost or run.failure.loses_memory
            pose = self._end_pose(stage)
            self._is_replaced = False
            if is_lost:
                self._state = EpisodeState()

    def _end_pose(self, stage: int) -> Pose:
        """Return the pose at which a stage ends; a guided stage ends at its walk's end even if the agent failed."""
        pose, walk = self._context.simulator.pose, self._spec.stages[stage - 1].guided
        return pose if walk is None else replace(walk.end, y_m=pose.y_m, horizon_rad=pose.horizon_rad)

    def _new_costs(self, failure: ErrorKind | None) -> Mapping[str, float]:
        """Return the costs of the agent's decision model in the stage; empty if they are unknown."""
        if failure is not None and failure.loses_memory:
            self._last_costs = {}
            return {}
        costs, before = self._context.agent.costs(), self._last_costs
        self._last_costs = costs
        return {name: value if name in LEVELS else value - before.get(name, 0) for name, value in costs.items()}

    def replace_agent(self, agent: Agent) -> None:
        """Use another agent from the next stage on, as after the loss of a process; for replays in one process."""
        hosted, baseline = _hosted(agent)
        self._context = replace(self._context, agent=hosted, baseline=baseline)
        self._is_replaced = True

    def _cpu_s(self) -> float:
        """Return the CPU time of this process, or of what of it is the episode's, and of the agent's own process."""
        return self._own_cpu_s() + self._context.agent.cpu_s


def _hosted(agent: Agent | HostedAgent) -> tuple[HostedAgent, OracleBaseline | None]:
    """Return the agent as a stage asks it, and itself if it is an oracle baseline."""
    hosted = agent if isinstance(agent, HostedAgent) else LocalAgent(agent)
    baseline = agent if isinstance(agent, OracleBaseline) and _is_own(agent) else None
    return hosted, baseline


def _is_own(baseline: OracleBaseline) -> bool:
    """Return whether an oracle baseline is one of evonav's own."""
    from evonav.evaluation.episode.oracle_baselines import ORACLE_BASELINES  # which imports agents

    return type(baseline) in ORACLE_BASELINES.values()
