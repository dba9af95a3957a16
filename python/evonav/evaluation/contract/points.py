"""Check the points of the contract that one episode shows."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

from evonav.agents.hosting.error_text import describe
from evonav.errors import InvalidArgumentError
from evonav.evaluation.contract.probe import Probe
from evonav.evaluation.hosting.agent import LocalAgent
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.schema import StageRecord

PROTOCOL = ProtocolConfig(max_rounds=10, max_actions=40)
"""The protocol of the checks; its stages are shorter than an evaluation's."""
SLOW_ROUND_S = 1.0
PACKAGE = "evonav.evaluation"

Verdict = Literal["pass", "warn", "fail", "skip"]


@dataclass(frozen=True, slots=True)
class Check:
    """The result of the check of one point of the contract."""

    name: str
    verdict: Verdict
    finding: str
    """The finding, and what to do about it."""


@dataclass(frozen=True, slots=True, repr=False)
class ContractReport:
    """The result of all checks of an agent or a memory."""

    name: str
    """Name of what was checked."""
    checks: tuple[Check, ...]

    @property
    def is_ok(self) -> bool:
        """True if no check failed; there may be warnings."""
        return not any(check.verdict == "fail" for check in self.checks)

    @property
    def conclusion(self) -> str:
        """The result in one line: whether it keeps the contract, breaks it, or could not be run at all."""
        if any(check.name == "importable" and check.verdict == "fail" for check in self.checks):
            return f"{self.name}: cannot be checked"
        return f"{self.name}: {'keeps the contract' if self.is_ok else 'breaks the contract'}"

    def __repr__(self) -> str:
        """Return the conclusion and every check, a line each."""
        width = max(len(check.name) for check in self.checks)
        lines = [f"{check.verdict:4}  {check.name:{width}}  {check.finding}" for check in self.checks]
        return "\n".join([self.conclusion, *lines])


def points_of(probe: Probe, records: Sequence[StageRecord]) -> Iterator[Check]:
    """Yield the checks of an agent that has run one episode."""
    yield _sensors(probe)
    calls = {"begin_task": "a new house", "begin_stage": "a new goal in the same house", "act": "a decision round"}
    for name, what in calls.items():
        error = probe.errors.get(name)
        if error is not None:
            yield Check(name, "fail", f"raises {describe(error, caller=PACKAGE)}")
        elif probe.calls[name]:
            count = "once" if probe.calls[name] == 1 else f"{probe.calls[name]} times"
            yield Check(name, "pass", f"called {count}: {what}")
        else:
            yield Check(name, "skip", "not reached")
    if "explain" in probe.errors and not probe.calls["act"]:
        yield _diagnostics(probe)
    if probe.calls["act"]:
        yield _actions(probe, records)
        yield _budget(probe, records)
        changed = probe.changed()
        if changed:
            yield Check("observations", "warn", f"the agent writes into arrays that it receives ({changed}): copy them")
        else:
            yield Check("observations", "pass", "the arrays that the agent received are unchanged at the end")
        yield _diagnostics(probe)
        if probe.explains:
            yield _entries(probe)
        if probe.seconds:
            mean_s, worst_s = sum(probe.seconds) / len(probe.seconds), max(probe.seconds)
            finding = f"{1000 * mean_s:.0f} ms a round, {1000 * worst_s:.0f} ms at worst"
            yield Check("time", "warn" if mean_s > SLOW_ROUND_S else "pass", finding)


def _sensors(probe: Probe) -> Check:
    try:
        sensors = LocalAgent(probe).sensors
    except Exception as error:
        return Check("sensors", "fail", str(error))
    try:
        PROTOCOL.check(sensors)
    except InvalidArgumentError as error:
        return Check("sensors", "fail", f"{error}; `evonav.evaluation.protocol.ProtocolConfig` has the limits")
    finding = f"{sensors.first_round.count} views, then {sensors.later_rounds.count}; {sensors.motion}"
    return Check("sensors", "pass", finding)


def _actions(probe: Probe, records: Sequence[StageRecord]) -> Check:
    errors = [record.error for record in records if record.error is not None and record.error.kind.is_agents]
    rounds = [entry for record in records for entry in record.trace]
    if errors and not probe.errors:
        return Check("actions", "fail", errors[0].message)
    if not rounds:
        return Check("actions", "skip", "not reached")
    if len(rounds) > 3 and not any(entry.is_action_success for entry in rounds):
        return Check("actions", "warn", f"all {len(rounds)} are valid and none could be carried out")
    return Check("actions", "pass", f"all {len(rounds)} are valid")


def _budget(probe: Probe, records: Sequence[StageRecord]) -> Check:
    scored = [record for record in records if record.is_scored]
    if not scored:
        return Check("budget", "skip", "no stage was finished")
    num_stopped = sum(record.has_stopped for record in scored)
    budget = PROTOCOL.budget(probe.sensors)
    finding = f"the agent ended {num_stopped} of {len(scored)} stages itself, within {budget} rounds"
    if len(scored) > 1 and all(record.num_rounds == 1 for record in scored):
        return Check("budget", "warn", f"{finding}; it never did anything else")
    return Check("budget", "pass", finding)


def _diagnostics(probe: Probe) -> Check:
    if not probe.explains:
        finding = "no `explain()`: pages cannot show what the agent knows; return Explanation(map=..., objects=...)"
        return Check("diagnostics", "warn", finding)
    if (error := probe.errors.get("explain") or probe.errors.get("diagnostics")) is not None:
        return Check("diagnostics", "fail", f"{describe(error, caller=PACKAGE)}; see `evonav.Explanation`")
    return Check("diagnostics", "pass", f"JSON-ready, {probe.largest_diagnostics} bytes a round at most")


def _entries(probe: Probe) -> Check:
    if (error := probe.errors.get("entries")) is not None:
        return Check("entries", "fail", f"{describe(error, caller=PACKAGE)}; see `EntryBelief`")
    if probe.outside:
        return Check("entries", "fail", f"{probe.outside[0]}; centres are (x, y, z) in metres, in the world's frame")
    return Check("entries", "pass", f"{probe.num_entries} at the end of stages, all within the map")
