"""Name the parts of a run by import path, so that workers build them for themselves."""

from collections import deque
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass, fields, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

from evonav.agents.agent import Agent
from evonav.agents.hosting.sandbox import sandbox_problem
from evonav.agents.registry import BUILT_IN, RULE_MARK, agent_descriptions, agent_factory, new_agent
from evonav.component import Component
from evonav.decision.question import DecisionModel
from evonav.errors import InvalidArgumentError
from evonav.evaluation.baselines import ORACLE_BASELINE_NAMES
from evonav.evaluation.episode.spec import EpisodeSpec
from evonav.evaluation.hosting.fork_server import ForkServer
from evonav.evaluation.hosting.isolation import NO_SETUP, AgentHosting, ProcessSetup
from evonav.evaluation.hosting.model_relay import sandboxed_model_problem
from evonav.evaluation.hosting.process import check_importable
from evonav.evaluation.hosting.processes import new_fork_server
from evonav.perception import Perception
from evonav.perception.shorthand import GROUND_TRUTH
from evonav.world.simulator import Simulator, SimulatorConfig, vertical_fov_deg

TASK_FILES: Component[EpisodeSpec] = Component("evonav.evaluation.run.components:load_spec")
TRUE_PERCEPTION: Component[Perception] = Component(GROUND_TRUTH)
TEXT_MATCH: Component[DecisionModel] = Component("evonav.decision.backends:text_match")
USUAL_CAMERA = {"width_px": 300, "height_px": 300, "hfov_deg": 90.0}
"""The camera of runs whose headers do not say another one: options of simulators, with AI2-THOR's defaults."""
EMBEDDED: Component[Simulator] = Component(
    "evonav.evaluation.run.components:embedded_simulator", {"style": SimulatorConfig().style}
)
RECENT_HOUSES: deque[Any] = deque(maxlen=8)
"""Houses of this process's simulators: the next agent in a task finds those of its stages there."""


@runtime_checkable
class Startable(Protocol):
    """A simulator that runs in a process of its own, which takes time to start and may fail to."""

    def start(self) -> None:
        """Start the process, without a house."""
        ...


@runtime_checkable
class NeedsResources(Protocol):
    """A perception that needs libraries, files or a device, which may be missing here."""

    def check(self, agents: Sequence[str]) -> Mapping[str, Any]:
        """Check that all that these agents need is here, and return what of it decides what they see."""
        ...


@dataclass(frozen=True, slots=True)
class Backend:
    """The parts of a run that workers build for themselves."""

    tasks: Component[EpisodeSpec] = TASK_FILES
    """Reads a task; called with the task's folder."""
    simulator: Component[Simulator] = EMBEDDED
    perception: Component[Perception] = TRUE_PERCEPTION
    decision: Component[DecisionModel] = TEXT_MATCH
    """Called with the seed of the episode's agent."""

    def identity(self) -> dict[str, Any]:
        """Return what a run's header says of its parts: each by its name, and its options by `NAME_options`.

        Runs are resumed only where it is equal; `from_identity` reads it.
        """
        parts: dict[str, Any] = {}
        for one in fields(self):
            component: Component[Any] = getattr(self, one.name)
            parts |= component.identity(one.name)
        return parts

    @classmethod
    def from_identity(cls, values: Mapping[str, Any]) -> "Backend":
        """Return the parts that a run's header describes.

        Args:
            values: The header's `config.backend`.

        Raises:
            ValueError: An entry is unknown.
        """
        names = [one.name for one in fields(cls)]
        unknown = values.keys() - {entry for name in names for entry in (name, f"{name}_options")}
        if unknown:
            raise ValueError(f"unknown entries {sorted(unknown)}")
        default = cls()
        return cls(
            **{
                name: Component(values.get(name, getattr(default, name).path), values.get(f"{name}_options", {}))
                for name in names
            }
        )

    def check(self) -> None:
        """Create a perception and a simulator, start the simulator if it runs in a process of its own, and close it.

        Raises:
            InvalidArgumentError: The options of one are invalid.
            SimulationError: The simulator does not start; the message says what to do.
        """
        self.perception.create()
        simulator = self.simulator.create()
        try:
            if isinstance(simulator, Startable):
                simulator.start()
        finally:
            simulator.close()

    def check_perception(self, agents: Sequence[str]) -> dict[str, Any]:
        """Check that the perception finds all that it needs here.

        Returns:
            Hashes of weights and versions of libraries, where they decide what the agents see.

        Raises:
            InvalidArgumentError: Its options are invalid.
            PerceptionError: Something that it needs is missing; the message says what to do.
        """
        perception = self.perception.create()
        return dict(perception.check(agents)) if isinstance(perception, NeedsResources) else {}


def make_agent(name: str, decision: DecisionModel | None = None) -> Agent:
    """Make an agent or oracle baseline.

    Args:
        name: Name of a built-in agent or plug-in, or import path of a class.
        decision: Decision model for agents that take one; default: their own.

    Raises:
        InvalidArgumentError: No agent has this name.
    """
    if name in ORACLE_BASELINE_NAMES:
        from evonav.evaluation.episode.oracle_baselines import new_oracle_baseline

        return new_oracle_baseline(name, decision)
    return new_agent(agent_factory(name), decision)


def check_agent_names(
    names: Sequence[str], hosting: AgentHosting | None = None, setup: ProcessSetup = NO_SETUP
) -> None:
    """Check that workers can make these agents.

    Args:
        hosting: The place where agents run: those that are not built in are imported there, in processes that share
            what they import. Default: in this process.

    Raises:
        InvalidArgumentError: No agent has one of the names, or it cannot be imported.
    """
    with ExitStack() as stack:
        fork_server: ForkServer | None = None
        if hosting is not None and len(names) > 1 and (fork_server := new_fork_server(hosting, setup)) is not None:
            stack.enter_context(closing(fork_server))  # which starts nothing yet
        for name in names:
            if name in ORACLE_BASELINE_NAMES or name in BUILT_IN:
                continue
            try:
                if hosting is None or hosting.is_in_process or name.partition(RULE_MARK)[0] in BUILT_IN:
                    agent_factory(name)
                else:
                    check_importable(name, hosting, setup, fork_server)
            except InvalidArgumentError as error:
                if ":" in name or name.endswith(".py") or RULE_MARK in name:
                    raise
                near = get_close_matches(name, (*agent_descriptions(), *ORACLE_BASELINE_NAMES), 1)
                known = ", ".join(sorted(ORACLE_BASELINE_NAMES))
                hint = f"; did you mean `{near[0]}`?" if near else f"; oracle baselines are {known}"
                raise InvalidArgumentError(f"{error}{hint}") from error


def load_spec(path: Path) -> EpisodeSpec:
    """Read a task from its folder."""
    from evonav.evaluation.episode.spec import episode_spec
    from evonav.tasks import load_task

    return episode_spec(load_task(path))


def embedded_simulator(**options: Any) -> Simulator:  # noqa: ANN401 - `style` and those of `USUAL_CAMERA`
    """Make evonav's own simulator, with AI2-THOR's defaults."""
    from evonav.world.embedded import EmbeddedSimulator

    return EmbeddedSimulator(_config(**options), recent=RECENT_HOUSES)


def lenient_simulator(**options: Any) -> Simulator:  # noqa: ANN401 - `style` and those of `USUAL_CAMERA`
    """Make evonav's own simulator; assets missing from the catalogue get the usual size of their category."""
    from evonav.world.embedded import EmbeddedSimulator

    return EmbeddedSimulator(_config(**options), allow_unknown_assets=True, recent=RECENT_HOUSES)


def ai2thor_simulator(**options: Any) -> Simulator:  # noqa: ANN401 - of `USUAL_CAMERA` and `Ai2ThorOptions`
    """Make AI2-THOR's simulator, which is run through its client."""
    from evonav.world.ai2thor import Ai2ThorOptions, Ai2ThorSimulator

    camera = {key: options.pop(key) for key in USUAL_CAMERA if key in options}
    return Ai2ThorSimulator(_config(**camera), Ai2ThorOptions(**options))


def _config(hfov_deg: float = USUAL_CAMERA["hfov_deg"], **values: Any) -> SimulatorConfig:  # noqa: ANN401 - its fields
    config = SimulatorConfig(**values)
    return replace(config, vertical_fov_deg=vertical_fov_deg(hfov_deg, config.width_px, config.height_px))


def check_sandbox(decision: Component[DecisionModel]) -> None:
    """Check that agents which ask this decision model can run in a sandbox; an `InvalidArgumentError` says why not."""
    if reason := sandbox_problem() or sandboxed_model_problem(decision):
        raise InvalidArgumentError(f"isolation = sandbox: {reason}")
