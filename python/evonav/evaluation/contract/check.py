"""Does an agent keep the contract? One house that changes, a few rounds, by the same protocol as an evaluation.

First in a process of its own, where it may break what it likes, then here, where it can be looked at.
"""

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

from evonav.agents.agent import Agent, Sensing
from evonav.agents.hosting.error_text import describe
from evonav.agents.registry import agent_factory, new_agent
from evonav.evaluation.contract.probe import Probe
from evonav.evaluation.episode.episode import Episode
from evonav.evaluation.episode.oracle_baselines import ORACLE_BASELINES
from evonav.evaluation.episode.spec import EpisodeSpec
from evonav.evaluation.hosting.agent import HostedAgent, LocalAgent, RemoteAgent
from evonav.evaluation.hosting.process import AgentHosting, AgentProcesses
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.schema import ErrorKind, StageRecord
from evonav.evaluation.run.components import Backend
from evonav.tasks.bundled import bundled_tasks

PROTOCOL = ProtocolConfig(max_rounds=10, max_actions=40)
"""Shorter than an evaluation's."""
SLOW_ROUND_S = 1.0
LARGE_MEMORY_MB = 2000.0
_PACKAGE = "evonav.evaluation"

Verdict = Literal["pass", "warn", "fail", "skip"]


@dataclass(frozen=True, slots=True)
class Check:
    """A point of the contract."""

    name: str
    verdict: Verdict
    said: str
    """What was found, and what to do about it."""


@dataclass(frozen=True, slots=True)
class AgentReport:
    """How an agent keeps the contract."""

    agent: str
    checks: tuple[Check, ...]

    @property
    def is_ok(self) -> bool:
        """Nothing failed; there may be warnings."""
        return not any(check.verdict == "fail" for check in self.checks)

    def __str__(self) -> str:
        width = max(len(check.name) for check in self.checks)
        lines = [f"{check.verdict:4}  {check.name:{width}}  {check.said}" for check in self.checks]
        return "\n".join([f"{self.agent}: {'keeps the contract' if self.is_ok else 'breaks the contract'}", *lines])


def check_agent(
    agent: str | Callable[..., Agent] | Agent,
    *,
    backend: Backend | None = None,
    seed: int = 0,
    timeout_s: float = 60.0,
) -> AgentReport:
    """Runs an agent through the contract; it raises nothing, whatever the agent does.

    Args:
        agent: A name as for `evonav evaluate`, a class or function that makes one, or an agent, of whose class others
            are made. What can only be had as an object cannot be tried in a process of its own: if it kills its
            process, that is this one.
        backend: Of the evaluation, for its decision model.
        seed: Of the agent.
        timeout_s: For an answer.
    """
    return _Examination(agent, backend or Backend(), seed, timeout_s).report()


@dataclass(slots=True)
class _Run:
    """What became of one or more episodes of one agent object."""

    records: list[StageRecord] = field(default_factory=list)
    probe: Probe | None = None
    memory_mb: float | None = None

    @property
    def failures(self) -> list[StageRecord]:
        return [record for record in self.records if record.error is not None and record.error.kind.is_agents]

    @property
    def actions(self) -> list[tuple[int, Any]]:
        return [(record.stage, entry.action) for record in self.records for entry in record.trace]


class _Examination:
    def __init__(
        self, agent: str | Callable[..., Agent] | Agent, backend: Backend, seed: int, timeout_s: float
    ) -> None:
        self._backend = backend
        self._seed = seed
        self._hosting = AgentHosting(timeout_s=timeout_s)
        self._checks: list[Check] = []
        self._name, self._factory = _named(agent)

    def report(self) -> AgentReport:
        if self._name in ORACLE_BASELINES:
            self._say("importable", "fail", "an oracle baseline of the evaluator: it knows the target and is no agent")
        else:
            with bundled_tasks() as directory:
                cases = _changing_cases(self._backend, directory)
                self._examine(*cases)
        return AgentReport(self._name, tuple(self._checks))

    def _say(self, name: str, verdict: Verdict, said: str) -> None:
        self._checks.append(Check(name, verdict, said))

    def _examine(self, case: EpisodeSpec, other: EpisodeSpec) -> None:
        alone: _Run | None = None
        if self._factory is None or _is_found(self._name, self._factory):
            alone = self._own_process(case)
            if alone is None:
                return
        else:
            self._say(
                "own process",
                "warn",
                f"`{self._name}` is not found where its name says: define the class in a module or file, outside of "
                "functions, so that evaluations can run it in a process of its own",
            )
        try:
            factory = self._factory or agent_factory(self._name)
            first = self._here(factory, [case])
        except BaseException as error:  # SystemExit too: it is a stranger's code
            self._say(
                "made",
                "fail",
                f"making it raises {describe(error, caller=_PACKAGE)}; it must do without arguments",
            )
            return
        self._look(first)
        if first.failures:
            return
        self._compare(factory, case, other, first, alone)

    def _own_process(self, case: EpisodeSpec) -> _Run | None:
        """An episode in a process of its own; `None` where there is no use in going on."""
        run = _Run()
        with closing(AgentProcesses(self._hosting)) as processes:
            agent = RemoteAgent(processes, self._name, self._backend.decision, self._seed)
            for record in self._episode(agent, case):
                run.records.append(record)
                if record.error is not None and record.error.kind in (ErrorKind.CRASH, ErrorKind.TIMEOUT):
                    self._say("own process", "fail", f"stage {record.stage}: {record.error.message}")
                    return None
                used_mb = processes.process(self._name).memory_mb if record.num_rounds else None
                run.memory_mb = used_mb or run.memory_mb
        first = run.records[0]
        if first.error is not None and not first.trace and "cannot be imported" in first.error.message:
            self._say("importable", "fail", first.error.message)
            return None
        if first.error is not None and "no agent `" in first.error.message:
            self._say("importable", "fail", first.error.message)
            return None
        self._say("importable", "pass", f"`{self._name}` is found by a process of its own")
        return run

    def _here(self, factory: Callable[..., Agent], cases: Sequence[EpisodeSpec], probe: Probe | None = None) -> _Run:
        """Episodes of one agent object in this process."""
        probe = probe or Probe(new_agent(factory, self._backend.decision.create(self._seed)))
        run = _Run(probe=probe)
        for case in cases:
            run.records += self._episode(probe, case)
        return run

    def _episode(self, agent: Agent | HostedAgent, case: EpisodeSpec) -> Iterator[StageRecord]:
        with closing(self._backend.simulator.create()) as simulator:
            perception = self._backend.perception.create()
            episode = Episode(case, self._name, agent, simulator, perception, PROTOCOL, self._seed)
            for outcome in episode.run():
                yield outcome.record

    def _look(self, run: _Run) -> None:
        """What one episode tells."""
        probe = run.probe
        assert probe is not None
        self._say("made", "pass", "without arguments, or with `decision` alone")
        self._check_sensing(probe)
        for name, what in (
            ("begin_task", "a new house"),
            ("begin_stage", "a new goal in the same house"),
            ("act", "a decision round"),
        ):
            error = probe.errors.get(name)
            if error is not None:
                self._say(name, "fail", f"raises {describe(error, caller=_PACKAGE)}")
            elif probe.calls[name]:
                self._say(name, "pass", f"called {probe.calls[name]} times: {what}")
            else:
                self._say(name, "skip", "not reached")
        if probe.calls["act"]:
            self._check_actions(run)
            self._check_budget(run)
            self._check_observations(probe)
            self._check_diagnostics(probe)
            self._check_entries(probe)
            self._check_time(probe)

    def _check_sensing(self, probe: "Probe") -> None:
        try:
            sensing = LocalAgent(probe).sensing
            PROTOCOL.check(sensing)
        except Exception as error:
            self._say("sensing", "fail", f"{error}; see `evonav.evaluation.protocol.ProtocolConfig` for the caps")
            return
        said = f"{sensing.first_round.count} views, then {sensing.later_rounds.count}; {sensing.motion}"
        self._say("sensing", "pass", said)

    def _check_actions(self, run: _Run) -> None:
        probe = run.probe
        assert probe is not None
        broken = next((r.error.message for r in run.failures if r.error is not None and not probe.errors), None)
        rounds = [entry for record in run.records for entry in record.trace]
        if broken is not None:
            self._say("actions", "fail", broken)
        elif not rounds:
            self._say("actions", "skip", "not reached")
        elif len(rounds) > 3 and not any(entry.is_action_success for entry in rounds):
            self._say("actions", "warn", f"all {len(rounds)} are valid and none could be carried out")
        else:
            self._say("actions", "pass", f"all {len(rounds)} are valid")

    def _check_budget(self, run: _Run) -> None:
        scored = [record for record in run.records if record.is_scored]
        if not scored:
            self._say("budget", "skip", "no stage was finished")
            return
        stopped = sum(record.has_stopped for record in scored)
        said = f"of {len(scored)} stages it ended {stopped} itself, within {PROTOCOL.budget(_sensing(run))} rounds"
        at_once = len(scored) > 1 and all(record.num_rounds == 1 for record in scored)
        self._say("budget", "warn" if at_once else "pass", said + ("; it never did anything else" if at_once else ""))

    def _check_observations(self, probe: "Probe") -> None:
        changed = probe.changed()
        if changed:
            self._say("observations", "warn", f"it writes into what it is given ({changed}): copy arrays first")
        else:
            self._say("observations", "pass", "arrays that it was given are as they were, to the end")

    def _check_diagnostics(self, probe: "Probe") -> None:
        if not probe.explains:
            self._say("diagnostics", "warn", "no `diagnostics()` and `entries()`: reports cannot show what it believes")
        elif (error := probe.errors.get("diagnostics")) is not None:
            self._say("diagnostics", "fail", f"{describe(error, caller=_PACKAGE)}; see `RoundDiagnostics`")
        else:
            self._say("diagnostics", "pass", f"JSON-ready, {probe.largest_diagnostics} bytes a round at most")

    def _check_entries(self, probe: "Probe") -> None:
        if not probe.explains:
            return
        if (error := probe.errors.get("entries")) is not None:
            self._say("entries", "fail", f"{describe(error, caller=_PACKAGE)}; see `EntryBelief`")
        elif probe.outside:
            self._say("entries", "fail", f"{probe.outside[0]}; centres are (x, y, z) in metres, in the world's frame")
        else:
            self._say("entries", "pass", f"{probe.num_entries} at the end of stages, all within the map")

    def _check_time(self, probe: "Probe") -> None:
        if not probe.seconds:
            return
        mean_s, worst_s = sum(probe.seconds) / len(probe.seconds), max(probe.seconds)
        said = f"{1000 * mean_s:.0f} ms a round, {1000 * worst_s:.0f} ms at worst"
        self._say("time", "warn" if mean_s > SLOW_ROUND_S else "pass", said)

    def _compare(
        self, factory: Callable[..., Agent], case: EpisodeSpec, other: EpisodeSpec, first: _Run, alone: _Run | None
    ) -> None:
        again = self._here(factory, [case])
        difference = _difference(first, again)
        if difference is not None:
            self._say(
                "same seed twice",
                "fail",
                f"{difference}: draw from `TaskInfo.seed`, and keep nothing in modules or classes",
            )
        else:
            self._say("same seed twice", "pass", f"the same {len(first.actions)} actions")
        if alone is not None:
            self._compare_processes(first, alone, is_steady=difference is None)
        elsewhere = self._here(factory, [other])
        followed = self._here(factory, [other], again.probe)
        difference_after = _difference(elsewhere, followed)
        if difference is not None:
            self._say("new task", "skip", "cannot be told of an agent that does not do the same twice")
        elif difference_after is not None:
            self._say(
                "new task", "fail", f"after another task, {difference_after}: `begin_task` must forget everything"
            )
        else:
            self._say("new task", "pass", "after another task it does as a fresh agent does")

    def _compare_processes(self, first: _Run, alone: _Run, *, is_steady: bool) -> None:
        difference = _difference(first, alone)
        if difference is not None and is_steady:
            self._say("own process", "fail", f"elsewhere than here, {difference}: does it read what is not there?")
        elif difference is not None:
            self._say("own process", "skip", "cannot be told of an agent that does not do the same twice")
        else:
            self._say("own process", "pass", "does there as it does here")
        if alone.memory_mb is not None:
            verdict: Verdict = "warn" if alone.memory_mb > LARGE_MEMORY_MB else "pass"
            self._say("memory", verdict, f"{alone.memory_mb:.0f} MB in a process of its own")


def _named(agent: str | Callable[..., Agent] | Agent) -> tuple[str, Callable[..., Agent] | None]:
    """The name that an evaluation would know an agent by, and what makes it if that is at hand."""
    if isinstance(agent, str):
        return agent, None
    factory: Any = agent if isinstance(agent, type) or not hasattr(agent, "act") else type(agent)
    module = getattr(factory, "__module__", "?")
    name = getattr(factory, "__qualname__", type(factory).__name__)
    if module == "__main__":
        module = getattr(sys.modules["__main__"], "__file__", None) or module
    return f"{module}:{name}", factory


def _is_found(name: str, factory: Callable[..., Agent]) -> bool:
    """Whether another process can find what is at hand here."""
    module, _, attribute = name.rpartition(":")
    if module.endswith(".py"):
        return "." not in attribute and Path(module).is_file()
    return getattr(sys.modules.get(module), attribute, None) is factory


def _changing_cases(backend: Backend, directory: Path) -> tuple[EpisodeSpec, EpisodeSpec]:
    """Two bundled tasks, each up to its first stage before which things were moved."""
    found = []
    for root in sorted(path.parent for path in directory.glob("*/task.json")):
        case = backend.tasks.create(root)
        last = next((k for k, stage in enumerate(case.stages) if stage.transition.relocations), None)
        if last is not None:
            found.append(replace(case, stages=case.stages[: last + 1]))
        if len(found) == 2:
            break
    return found[0], found[1]


def _difference(first: _Run, second: _Run) -> str | None:
    """The first action that is not the same."""
    for one, two in zip(first.actions, second.actions, strict=False):
        if one != two:
            return f"in stage {one[0]} it answers {_words(two[1])} where it answered {_words(one[1])}"
    if len(first.actions) != len(second.actions):
        return f"it acts {len(second.actions)} times where it acted {len(first.actions)} times"
    return None


def _words(action: Any) -> str:  # noqa: ANN401 - `ActionRecord`
    details = action.position_m or action.action or action.reason or ""
    return f"{action.kind} {details}".strip()


def _sensing(run: _Run) -> Sensing:
    assert run.probe is not None
    return run.probe.sensing
