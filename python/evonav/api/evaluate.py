"""Evaluate agents from Python: `evonav.evaluate`."""

import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from evonav.agents.agent import Agent
from evonav.agents.hosting.serving import refuse_in_agent_process
from evonav.api.agents import NamedAgents, named_agents
from evonav.api.loading import TaskSource, task_list
from evonav.api.progress import progress_bar
from evonav.api.run import Run
from evonav.errors import InvalidArgumentError
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.run.evaluate import evaluate_all
from evonav.evaluation.run.run import Evaluation
from evonav.evaluation.run.run_settings import RunSettings, Settings, SpendingSettings, settings_of
from evonav.evaluation.run.settings import CommandSettings, DecisionSettings, PerceptionSettings, SimulatorSettings

AgentSource = str | Callable[..., Agent]
"""A name, a class, or a function that makes an agent."""
SettingsT = TypeVar("SettingsT", bound=Settings)


def evaluate(
    *agents: AgentSource,
    tasks: TaskSource = "bundled",
    limit: int | None = None,
    out: str | Path | None = None,
    seed: int = 0,
    workers: int | None = None,
    decision: str | Mapping[str, Any] | DecisionSettings = "text",
    perception: str | Mapping[str, Any] | PerceptionSettings = "gt",
    simulator: str | Mapping[str, Any] | SimulatorSettings = "embedded",
    spending: Mapping[str, Any] | SpendingSettings | None = None,
    protocol: ProtocolConfig | None = None,
    retry_errored: bool = False,
    **options: Any,  # noqa: ANN401 - fields of `RunSettings`
) -> Run:
    """Evaluate agents on tasks; call it again with the same `out` to resume.

    Classes of a module run in worker processes. Classes of a notebook, of the running script or of a function, and
    lambdas, which workers cannot import, run in this process, and are recorded by the name of their class.

    Args:
        *agents: Names as in `evonav agents` (`"fu"`), classes, or functions that make an agent.
        tasks: `"bundled"`, a folder of tasks, a task, or a list of tasks.
        limit: Number of tasks to take, from the first. Default: all.
        out: Folder of the run. Default: a new temporary folder.
        seed: Seed of every random choice.
        workers: Number of worker processes; 0 runs in this process. Default: one per core.
        decision: Decision model: `"text"`, or the fields of `DecisionSettings`, such as
            `{"kind": "vlm", "model": "gpt-4o-mini"}`.
        perception: `"gt"`, `"noisy:PRESET"`, `"predicted:STACK"`, or the fields of `PerceptionSettings`.
        simulator: `"embedded"` or `"ai2thor"`, or the fields of `SimulatorSettings`.
        spending: Fields of `SpendingSettings`: prices of a VLM, and how much may be spent.
        protocol: Success radius and budgets. Default: the paper's.
        retry_errored: Run errored stages again.
        **options: Further fields of `RunSettings`, such as `stage_timeout_s=60.0`.

    Returns:
        The run, with all that it recorded.

    Raises:
        InvalidArgumentError: An argument is none of the above; the message names the nearest right one.
        TaskError: There are no such tasks.
        StoreError: The folder holds a run of another configuration or cannot be written.
        DecisionError: The decision model cannot be asked from here.

    Examples:
        >>> import evonav
        >>> class GiveUp(evonav.Agent):
        ...     def act(self, observation):
        ...         return evonav.Stop("gave up")
        >>> run = evonav.evaluate(GiveUp, limit=1)
        >>> run.agents
        ('GiveUp',)
    """
    refuse_in_agent_process("evonav.evaluate")
    named = named_agents(agents)
    run = read_settings(RunSettings, "", {**options, "workers": _num_workers(workers, named)}, "evaluate")
    settings = CommandSettings(
        **dict(run),
        **dict(read_settings(SpendingSettings, "", spending or {}, "spending")),
        decision=read_settings(DecisionSettings, "kind", decision, "decision"),
        perception=read_settings(PerceptionSettings, "make", perception, "perception"),
        simulator=read_settings(SimulatorSettings, "kind", simulator, "simulator"),
    )
    settings = settings.with_episodes([settings.decision.kind], [settings.simulator.kind])
    folder = Path(tempfile.mkdtemp(prefix="evonav-")) if out is None else Path(out)
    found = task_list(tasks, limit, folder)
    config = settings.run_config(seed, folder, protocol)
    config.backend.check()
    with progress_bar("stages") as show:
        evaluate_all(
            [Evaluation(named.names, tuple(found), folder, config)],
            settings.workforce(),
            num_retries=settings.num_retries,
            retry_errored=retry_errored,
            on_progress=lambda _, state: show(state.num_done, state.num_stages, state.label),
        )
    return Run(folder)


def _num_workers(workers: int | None, agents: NamedAgents) -> int | None:
    """Return the number of workers that is possible for these agents."""
    if not agents.local:
        return workers
    if workers:
        raise InvalidArgumentError(
            f"workers = {workers}: worker processes cannot import `{agents.local[0]}`; define it in a module of its "
            "own and import it from there, or leave `workers` out"
        )
    return 0


def read_settings(
    model: type[SettingsT], word: str, value: str | Mapping[str, Any] | SettingsT, name: str
) -> SettingsT:
    """Return settings from what an argument may be: a word, a mapping, or the settings themselves.

    Args:
        word: The field that a string sets.
        name: The argument's name, for errors.

    Raises:
        InvalidArgumentError: A field is unknown or has an invalid value.
    """
    if isinstance(value, model):
        return value
    values = {word: value} if isinstance(value, str) else value
    if not isinstance(values, Mapping):
        raise InvalidArgumentError(f"{name} = {value!r}: expected a word, or a dictionary of {model.__name__}'s fields")
    try:
        return settings_of(model, values)
    except InvalidArgumentError as error:
        raise InvalidArgumentError(f"{name}: {error}") from None
