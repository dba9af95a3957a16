"""Declare the options of a run's workers, limits and retries, once for Python, sweep files and commands."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, TypeVar

from pydantic import Field

from evonav.evaluation.hosting.isolation import IS_SUPPORTED, AgentHosting, Isolation, usual_isolation
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.run.settings_model import NUM_RETRIES, SettingError, Settings
from evonav.parallel.local import num_cores
from evonav.parallel.worker import EngineName, Workforce

if TYPE_CHECKING:
    from evonav.evaluation.run.components import Backend
    from evonav.evaluation.run.run import RunConfig
    from evonav.evaluation.run.settings import DecisionSettings, SimulatorSettings

SettingsT = TypeVar("SettingsT", bound="RunSettings")

VLM_EPISODES_AT_ONCE = 16
"""Episodes that a worker runs at once where a server is asked, which takes most of the time."""


class RunSettings(Settings):
    """The workers of a run, the limits of its agents, and its retries; none of it decides records."""

    workers: int | None = Field(default=None, ge=0)
    """Number of worker processes; 0 runs in this process. Default: one per core."""
    episodes_at_once: int | None = Field(default=None, ge=1, le=1000)
    """Number of episodes that each worker runs at once, so that one computes while others wait for a model.
    Default: 1, with a VLM 16."""
    engine: EngineName = "local"
    """Run workers as local processes or as Ray actors."""
    ray_address: str | None = None
    """Ray: address of a cluster that shares this file system. Default: start Ray on this machine."""
    worker_gpus: float = Field(default=0.0, ge=0.0)
    """Ray: GPUs reserved for each worker, such as 0.5, for perception that needs one."""
    num_retries: int = Field(default=NUM_RETRIES, ge=0)
    """Number of retries of a stage that lost its worker, simulator or agent process."""
    isolation: Isolation | None = None
    """The process of agents: the evaluator's, their own, or their own without files of tasks and network (Linux).
    Default: sandbox where this machine has one, else process."""
    stage_timeout_s: float | None = Field(default=None, gt=0.0)
    """Seconds before a stage is errored. Default: 900, with a VLM 14400."""
    agent_timeout_s: float | None = Field(default=None, ge=0.1)
    """Seconds to wait for an agent's answer before its stage is errored. Default: 600, with a VLM 3600."""
    agent_memory_mb: int | None = Field(default=None, ge=256)
    """Largest address space of an agent's process, in MB. Default: no limit."""

    @property
    def num_workers(self) -> int:
        """The number of workers: the given one, or one per core."""
        return num_cores() if self.workers is None else self.workers

    @property
    def num_episodes(self) -> int:
        """Number of episodes that are run at once, 1 or more; 1 a worker before `with_episodes`."""
        return max(1, self.num_workers) * (self.episodes_at_once or 1)

    def with_episodes(
        self: SettingsT, decisions: "Iterable[DecisionSettings]", simulators: "Iterable[SimulatorSettings]"
    ) -> SettingsT:
        """Return these settings with a number of episodes at once: the given one, or the default.

        Args:
            decisions: The decision models that these workers use.
            simulators: Their simulators; AI2-THOR's has a process for each episode, so only one runs by default.
        """
        if self.episodes_at_once is not None:
            return self
        waits = any(decision.kind == "vlm" for decision in decisions)
        is_light = all(simulator.kind == "embedded" for simulator in simulators)
        has_processes = IS_SUPPORTED and self.num_workers > 0 and self.isolation != "none"
        number = VLM_EPISODES_AT_ONCE if waits and is_light and has_processes else 1
        return self.model_copy(update={"episodes_at_once": number})

    def workforce(self) -> Workforce:
        """Return the workers.

        Raises:
            SettingError: An option is of Ray, and the workers are not; or agents without processes of their own are to
                run several episodes at once.
            InvalidArgumentError: There are too few workers.
        """
        for key in ("ray_address", "worker_gpus"):
            if getattr(self, key) and self.engine != "ray":
                raise SettingError(type(self), key, "is for engine ray")
        at_once = self.episodes_at_once or 1
        if at_once > 1 and (self.num_workers == 0 or self.isolation == "none"):
            reason = f"{at_once}: needs workers, and agents in processes of their own"
            raise SettingError(type(self), "episodes_at_once", reason)
        return Workforce(
            self.num_workers, self.engine, self.ray_address, num_gpus=self.worker_gpus, jobs_at_once=at_once
        )

    def config(
        self, seed: int, backend: "Backend", decisions: "DecisionSettings", protocol: ProtocolConfig | None = None
    ) -> "RunConfig":
        """Return the configuration of a run with these limits.

        Args:
            seed: Seed of every random choice.
            backend: The parts of the run.
            decisions: Settings of the decision model, which have the default limits.
            protocol: Default: the paper's.
        """
        from evonav.evaluation.run.run import RunConfig

        isolation = self.isolation or self._usual_isolation(backend)
        timeout_s = self.agent_timeout_s or decisions.answer_timeout_s
        return RunConfig(
            seed=seed,
            protocol=protocol or ProtocolConfig(),
            backend=backend,
            stage_timeout_s=self.stage_timeout_s or decisions.stage_timeout_s,
            hosting=AgentHosting(isolation, timeout_s, self.agent_memory_mb),
        )

    def _usual_isolation(self, backend: "Backend") -> Isolation:
        """Return the isolation of a run for which none is given."""
        from evonav.evaluation.hosting.model_relay import sandboxed_model_problem

        is_here = self.num_workers > 0 and self.engine == "local"
        return usual_isolation() if is_here and not sandboxed_model_problem(backend.decision) else "process"
