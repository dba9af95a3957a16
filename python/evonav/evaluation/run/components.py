"""What a worker builds for itself, named by import path so that it crosses process borders without pickle."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from difflib import get_close_matches
from importlib import import_module
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

from evonav.agents.agent import Agent
from evonav.agents.registry import BUILT_IN, agent_descriptions, agent_factory, new_agent
from evonav.decision.question import DecisionModel
from evonav.errors import InvalidArgumentError
from evonav.evaluation.episode.oracle_baselines import ORACLE_BASELINES, new_oracle_baseline
from evonav.evaluation.episode.spec import EpisodeSpec
from evonav.evaluation.hosting.process import DecisionSpec, check_importable
from evonav.perception import Perception
from evonav.perception.words import GROUND_TRUTH
from evonav.world.simulator import Simulator


@runtime_checkable
class Startable(Protocol):
    """A simulator with a process that takes its time, and may not come up."""

    def start(self) -> None:
        """Starts it, without a house."""
        ...


@runtime_checkable
class NeedsMeans(Protocol):
    """A perception of means that may be missing here: libraries, files, a device."""

    def check(self, agents: Sequence[str]) -> Mapping[str, Any]:
        """Whether all is there that these agents will need; what it is, as far as it decides what they see."""
        ...


@dataclass(frozen=True, slots=True)
class Backend:
    """Import paths (`module:function`) of what an episode needs."""

    cases: str = "evonav.evaluation.run.components:load_case"
    """Takes a task's directory, returns an `EpisodeSpec`."""
    simulator: str = "evonav.evaluation.run.components:embedded_simulator"
    """Makes a `Simulator`."""
    perception: str = GROUND_TRUTH
    """Makes a `Perception`."""
    perception_options: Mapping[str, Any] = field(default_factory=dict)
    """Keywords for `perception`, as JSON."""
    perception_host_options: Mapping[str, Any] = field(default_factory=dict)
    """More of them, on this machine's means (folder of models, device): not part of what makes runs the same."""
    simulator_options: Mapping[str, Any] = field(default_factory=dict)
    """Keywords for `simulator`, as JSON."""
    host_options: Mapping[str, Any] = field(default_factory=dict)
    """More of them, on this machine's means (GPU, display, timeouts): not part of what makes runs the same."""
    decision: str = "evonav.decision.backends:text_match"
    """Makes a `DecisionModel`; its first argument is the seed of the episode's agent."""
    decision_options: Mapping[str, Any] = field(default_factory=dict)
    """Keywords for `decision`, as JSON."""
    decision_host_options: Mapping[str, Any] = field(default_factory=dict)
    """More of them, on how the model is reached (address, file of exchanges, limits): no part of what makes runs the
    same."""

    def identity(self) -> dict[str, Any]:
        """What makes runs the same."""
        host = ("host_options", "perception_host_options", "decision_host_options")
        return {key: value for key, value in asdict(self).items() if key not in host and value != {}}

    def load_case(self, path: Path) -> EpisodeSpec:
        """A task as the evaluator runs it."""
        case: EpisodeSpec = _imported(self.cases)(path)
        return case

    def make_simulator(self) -> Simulator:
        """A simulator of the worker's own."""
        simulator: Simulator = _imported(self.simulator)(**self.simulator_options, **self.host_options)
        return simulator

    def check(self) -> None:
        """Starts a simulator and ends it, where that is something that can fail, and makes a perception.

        Raises:
            InvalidArgumentError: Their options make no sense.
            SimulationError: It does not start; the message says what to do.
        """
        self.make_perception()
        simulator = self.make_simulator()
        try:
            if isinstance(simulator, Startable):
                simulator.start()
        finally:
            simulator.close()

    def decision_spec(self) -> DecisionSpec:
        """How the decision model is made, for an agent in a process of its own."""
        return DecisionSpec(self.decision, {**self.decision_options, **self.decision_host_options})

    def make_decision(self, seed: int) -> DecisionModel:
        """A decision model for one agent's episode."""
        spec = self.decision_spec()
        model: DecisionModel = _imported(spec.path)(seed, **spec.options)
        return model

    def make_perception(self) -> Perception:
        """A perception of the worker's own."""
        options = {**self.perception_options, **self.perception_host_options}
        perception: Perception = _imported(self.perception)(**options)
        return perception

    def check_perception(self, agents: Sequence[str]) -> dict[str, Any]:
        """What decides what these agents see beside the perception's options: weights and versions, if it has some.

        Raises:
            InvalidArgumentError: Its options make no sense.
            PerceptionError: Something that it needs is missing here; the message says what to do.
        """
        perception = self.make_perception()
        return dict(perception.check(agents)) if isinstance(perception, NeedsMeans) else {}


def make_agent(name: str, decision: DecisionModel | None = None) -> Agent:
    """A fresh agent or oracle baseline.

    Args:
        name: Of a built-in agent, a plug-in or a class.
        decision: Handed to agents that take one; default: their own.

    Raises:
        InvalidArgumentError: There is none of this name.
    """
    return new_oracle_baseline(name, decision) if name in ORACLE_BASELINES else new_agent(agent_factory(name), decision)


def check_agent_name(name: str, *, is_in_process: bool = True) -> None:
    """Refuses a name that no worker could make an agent of.

    Args:
        name: Of an agent.
        is_in_process: Import it here; otherwise in a process of its own, unless it is one of ours.

    Raises:
        InvalidArgumentError: There is none of this name, or it cannot be imported.
    """
    if name in ORACLE_BASELINES:
        return
    try:
        if is_in_process or name in BUILT_IN:
            agent_factory(name)
        else:
            check_importable(name)
    except InvalidArgumentError as error:
        if ":" in name or name.endswith(".py"):
            raise
        near = get_close_matches(name, (*agent_descriptions(), *ORACLE_BASELINES), 1)
        known = ", ".join(sorted(ORACLE_BASELINES))
        hint = f"; did you mean `{near[0]}`?" if near else f"; oracle baselines are {known}"
        raise InvalidArgumentError(f"{error}{hint}") from error


def load_case(path: Path) -> EpisodeSpec:
    """A task on disk."""
    from evonav.evaluation.episode.spec import episode_spec
    from evonav.tasks import load_task

    return episode_spec(load_task(path))


def embedded_simulator() -> Simulator:
    """Evonav's own simulator, AI2-THOR's defaults."""
    from evonav.world.embedded import EmbeddedSimulator

    return EmbeddedSimulator()


def lenient_simulator() -> Simulator:
    """The same, drawing assets that the catalogue lacks in the usual size of their category."""
    from evonav.world.embedded import EmbeddedSimulator

    return EmbeddedSimulator(allow_unknown_assets=True)


def ai2thor_simulator(**options: Any) -> Simulator:  # noqa: ANN401 - of `Ai2ThorOptions`
    """AI2-THOR through its client."""
    from evonav.world.ai2thor import Ai2ThorOptions, Ai2ThorSimulator

    return Ai2ThorSimulator(options=Ai2ThorOptions(**options))


def _imported(path: str) -> Callable[..., Any]:
    module, _, attribute = path.partition(":")
    try:
        found: Callable[..., Any] = getattr(import_module(module), attribute)
    except (ImportError, AttributeError, ValueError) as error:
        raise InvalidArgumentError(f"`{path}` cannot be imported: {error}") from error
    return found
