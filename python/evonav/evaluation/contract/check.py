"""Check that an agent keeps the contract: a few rounds in a house that changes, by the protocol of an evaluation.

The agent first runs in a process of its own, where it can do no harm, and then in this process, where a `Probe` records
its calls.
"""

import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from evonav.agents.agent import Agent, AgentAction, Move, NavigateTo, Stop
from evonav.agents.hosting.error_text import describe
from evonav.agents.hosting.serving import refuse_in_agent_process
from evonav.agents.registry import agent_factory, import_name, needed_arguments, new_agent
from evonav.evaluation.baselines import ORACLE_BASELINE_NAMES
from evonav.evaluation.contract.points import PACKAGE, PROTOCOL, Check, ContractReport, points_of
from evonav.evaluation.contract.probe import Probe
from evonav.evaluation.contract.situations import check_situations
from evonav.evaluation.episode.episode import Episode
from evonav.evaluation.episode.spec import EpisodeSpec
from evonav.evaluation.hosting.agent import HostedAgent, RemoteAgent
from evonav.evaluation.hosting.isolation import AgentHosting
from evonav.evaluation.hosting.processes import AgentProcesses
from evonav.evaluation.records.schema import ErrorKind, StageRecord
from evonav.evaluation.run.components import Backend
from evonav.tasks.listing import BUNDLED_TASKS

LARGE_MEMORY_MB = 2000.0
ADVICE = "function without arguments that returns the agent, and name that"


def check_agent(
    agent: str | Callable[..., Agent] | Agent,
    *,
    backend: Backend | None = None,
    seed: int = 0,
    timeout_s: float = 60.0,
) -> ContractReport:
    """Run an agent and check that it keeps the contract; no exception of the agent is raised.

    Args:
        agent: A name as for `evonav evaluate`, a class or function that makes an agent, or an agent, of whose class
            others are made. What cannot be imported by a name runs only in this process: if it ends its process, this
            one ends.
        backend: The parts of the evaluation, such as its decision model.
        timeout_s: Time limit of an answer.

    Examples:
        >>> import evonav
        >>> report = evonav.check_agent("stay-still")
        >>> report.is_ok
        True
    """
    refuse_in_agent_process("evonav.check_agent")
    name, factory = _named(agent)
    examination = _Examination(name, factory, backend or Backend(), seed, timeout_s)
    return ContractReport(name, tuple(examination.checks()))


@dataclass(frozen=True, slots=True)
class _Examination:
    """Runs episodes of an agent, and compares them."""

    name: str
    factory: Callable[..., Agent] | None
    backend: Backend
    seed: int
    timeout_s: float

    def checks(self) -> Iterator[Check]:
        if self.name in ORACLE_BASELINE_NAMES:
            yield Check("importable", "fail", "an oracle baseline: it knows the target, and is no agent")
            return
        with closing(AgentProcesses(AgentHosting(timeout_s=self.timeout_s))) as processes:
            yield from self._checks(processes)

    def _checks(self, processes: AgentProcesses) -> Iterator[Check]:
        spec, other = _changing_tasks(self.backend)
        remote, memory_mb = None, None
        if self.factory is None or _is_importable(self.name, self.factory):
            remote, memory_mb = self._remote_run(spec, processes)
            first_check = self._check_remote(remote)
            yield first_check
            if first_check.verdict == "fail":
                return
        else:
            advice = "define the class in a module or file, outside of functions, so that evaluations can run it"
            finding = f"`{self.name}` cannot be imported by its name: {advice} in a process of its own"
            yield Check("own process", "warn", finding)
        try:
            factory = self.factory or agent_factory(self.name)
            if needed := ", ".join(f"`{name}`" for name in needed_arguments(factory)):
                yield Check("made", "fail", f"it needs the arguments {needed}: give them defaults, or make a {ADVICE}")
                return
            probe = self._probe(factory)
            first = list(self._episode(probe, spec))
        except BaseException as error:  # the code of others may raise SystemExit, too
            yield Check("made", "fail", f"making it raises {describe(error, caller=PACKAGE)}")
            return
        yield Check("made", "pass", "without arguments, or with `decision` alone")
        yield from points_of(probe, first)
        if not any(record.error is not None and record.error.kind.is_agents for record in first):
            yield from self._compare(factory, spec, other, first, remote, memory_mb)
            makes: Callable[[], Agent | HostedAgent] = partial(self._probe, factory)
            if remote is not None:
                makes = partial(RemoteAgent, processes, self.name, self.backend.decision, self.seed)
            yield from check_situations(self.backend, self.name, makes, self.seed)

    def _remote_run(self, spec: EpisodeSpec, processes: AgentProcesses) -> tuple[list[StageRecord], float | None]:
        """Run an episode in a process of its own, until that is lost; return the records, and its memory in MB."""
        records, memory_mb = [], None
        agent = RemoteAgent(processes, self.name, self.backend.decision, self.seed)
        for record in self._episode(agent, spec):
            records.append(record)
            if record.error is not None and record.error.kind in (ErrorKind.CRASH, ErrorKind.TIMEOUT):
                break
            memory_mb = (agent.memory_mb if record.num_rounds else None) or memory_mb
        agent.close()
        return records, memory_mb

    def _check_remote(self, records: Sequence[StageRecord]) -> Check:
        last, error = records[-1], records[0].error
        if last.error is not None and last.error.kind in (ErrorKind.CRASH, ErrorKind.TIMEOUT):
            return Check("own process", "fail", f"stage {last.stage}: {last.error.message}")
        is_unknown = error is not None and any(part in error.message for part in ("cannot be imported", "no agent `"))
        if error is not None and is_unknown and not records[0].trace:
            return Check("importable", "fail", error.message.removeprefix("InvalidArgumentError: ").partition(" [")[0])
        return Check("importable", "pass", f"a process of its own can import `{self.name}`")

    def _probe(self, factory: Callable[..., Agent]) -> Probe:
        return Probe(new_agent(factory, self.backend.decision.create(self.seed)))

    def _episode(self, agent: Agent | HostedAgent, spec: EpisodeSpec) -> Iterator[StageRecord]:
        with closing(self.backend.simulator.create()) as simulator:
            perception = self.backend.perception.create()
            episode = Episode(spec, self.name, agent, simulator, perception, PROTOCOL, self.seed)
            for outcome in episode.run():
                yield outcome.record

    def _compare(
        self,
        factory: Callable[..., Agent],
        spec: EpisodeSpec,
        other: EpisodeSpec,
        first: Sequence[StageRecord],
        remote: Sequence[StageRecord] | None,
        memory_mb: float | None,
    ) -> Iterator[Check]:
        """Run the agent again: under the same seed, in its own process, and after another task."""
        used = self._probe(factory)
        difference = _difference(first, self._episode(used, spec))
        is_steady = difference is None
        if is_steady:
            num = sum(len(record.trace) for record in first)
            yield Check("same seed twice", "pass", f"the same {num} actions")
        else:
            advice = "draw from `TaskInfo.seed`, and keep nothing in modules or classes"
            yield Check("same seed twice", "fail", f"{difference}: {advice}")
        if remote is not None:
            difference = _difference(first, remote)
            finding = f"in a process of its own, {difference}: does it read what is not there?"
            yield _equality("own process", is_steady, difference, finding, "acts there as it does here")
            if memory_mb is not None:
                finding = f"{memory_mb:.0f} MB in a process of its own"
                yield Check("memory", "warn" if memory_mb > LARGE_MEMORY_MB else "pass", finding)
        fresh = list(self._episode(self._probe(factory), other))
        difference = _difference(fresh, self._episode(used, other))
        finding = f"after another task, {difference}: `begin_task` must forget everything"
        yield _equality("new task", is_steady, difference, finding, "after another task it acts like a fresh agent")


def _equality(name: str, is_steady: bool, difference: str | None, failed: str, passed: str) -> Check:
    """Return the check that two episodes are equal, which means nothing for an agent that is not steady."""
    if not is_steady:
        return Check(name, "skip", "cannot be checked: the agent acts differently under the same seed")
    return Check(name, "pass", passed) if difference is None else Check(name, "fail", failed)


def _named(agent: str | Callable[..., Agent] | Agent) -> tuple[str, Callable[..., Agent] | None]:
    """Return the name by which an evaluation would know an agent, and its class or function if that is given."""
    if isinstance(agent, str):
        return agent, None
    factory: Any = agent if isinstance(agent, type) or not hasattr(agent, "act") else type(agent)
    module = getattr(factory, "__module__", "?")
    name = getattr(factory, "__qualname__", type(factory).__name__)
    if module == "__main__":
        module = getattr(sys.modules["__main__"], "__file__", None) or module
    return f"{module}:{name}", factory


def _is_importable(name: str, factory: Callable[..., Agent]) -> bool:
    """Return true if another process can import a class or function by its name."""
    module, _, attribute = name.rpartition(":")
    if module.endswith(".py"):
        return "." not in attribute and Path(module).is_file()
    return import_name(factory) is not None


def _changing_tasks(backend: Backend) -> tuple[EpisodeSpec, EpisodeSpec]:
    """Return two bundled tasks, each up to its first stage before which objects were moved."""
    found = []
    for root in sorted(path.parent for path in BUNDLED_TASKS.glob("*/task.json")):
        spec = backend.tasks.create(root)
        last = next((k for k, stage in enumerate(spec.stages) if stage.transition.relocations), None)
        if last is not None:
            found.append(replace(spec, stages=spec.stages[: last + 1]))
        if len(found) == 2:
            break
    return found[0], found[1]


def _difference(first: Iterable[StageRecord], second: Iterable[StageRecord]) -> str | None:
    """Describe the first action by which two episodes differ."""
    former, latter = (
        [(record.stage, entry.action) for record in records for entry in record.trace] for records in (first, second)
    )
    for (stage, before), (_, after) in zip(former, latter, strict=False):
        if before != after:
            return f"in stage {stage} it answers {_shown(after)} where it answered {_shown(before)}"
    if len(former) != len(latter):
        return f"it acts {len(latter)} times where it acted {len(former)} times"
    return None


def _shown(action: AgentAction) -> str:
    match action:
        case NavigateTo(place_m):
            return f"navigate_to {place_m}"
        case Move(step):
            return f"move {step.value}"
        case Stop(reason):
            return f"stop {reason}".strip()
