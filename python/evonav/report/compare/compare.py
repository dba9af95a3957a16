"""Compare agents on the same stages: differences with interval and p, in parts, and the stages that differ.

The statistics are those of `evonav.statistics`; what they mean and how they were calibrated is in docs/statistics.md.
"""

import shlex
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from evonav.errors import InvalidArgumentError
from evonav.evaluation.metrics.navigation import house_of
from evonav.evaluation.metrics.stage_metrics import StageMetrics
from evonav.evaluation.records.schema import EndState
from evonav.report.compare.selection import ComparedAgent, config_differences
from evonav.report.maps.stage_map import VIEW_DIR, page_name
from evonav.report.tables.causes import CAUSE_NAMES, FailureCause
from evonav.report.tables.table import MODES
from evonav.statistics import PairedEffect, mcnemar, paired_effects, with_holm

METRICS = {"success": "SR", "spl": "SPL", "soft_spl": "SoftSPL", "is_strict_success": "strict SR"}
"""Fields of a row that are compared unless others are asked for."""
SAME_PROTOCOL = ("protocol.", "tasks", "num_tasks")
"""Settings that two runs have to share."""
STRATA = {"stage_1": "first", "relocated": "moved", "not_relocated": "not moved"}
ALL = "all"
GUIDED = EndState.GUIDED.value
"""State of stages that the evaluator guided: no agent is scored on them, and they do not count as missing."""


@dataclass(frozen=True, slots=True)
class ComparedPart:
    """A comparison on some of the stages."""

    key: str
    """`all`, a stratum or a mode."""
    label: str
    n: int
    num_only_a: int
    """Stages where only `a` succeeded."""
    num_only_b: int
    mcnemar_p: float
    """P value that treats stages as independent; `effects["success"].p` resamples whole houses."""
    effects: Mapping[str, PairedEffect]
    """Effects by metric; a metric that no pair has is left out."""


@dataclass(frozen=True, slots=True)
class Flip:
    """A stage where exactly one of the two succeeded."""

    task_id: str
    stage: int
    category: str
    stratum: str
    mode: str
    winner: str
    loser: str
    cause: str
    """Reason why the other failed, in words."""
    pages: tuple[str | None, str | None]
    """Replays of the winner and the loser, as paths with fragments; `None` where `evonav view` has not written one."""
    command: str
    """Command that writes both pages."""


@dataclass(frozen=True, slots=True)
class Comparison:
    """The comparison of agent `b` with agent `a`: `b` minus `a`."""

    a: str
    b: str
    parts: tuple[ComparedPart, ...]
    """`all` first: its verdicts allow for the number of pairs compared, by Holm. Those of the others do not."""
    dropped: Mapping[str, int]
    """Stages of either that are not compared, by reason."""
    flips: tuple[Flip, ...]
    settings: Mapping[str, tuple[str, str]]
    """Settings in which the two runs differ."""

    @property
    def all(self) -> ComparedPart:
        """The comparison on all pairs of stages."""
        return self.parts[0]


def compare(
    compared_agents: Sequence[ComparedAgent],
    *,
    metrics: Sequence[str] = (),
    baseline: str | None = None,
    allow_differences: bool = False,
) -> list[Comparison]:
    """Compare every pair of agents, or each agent with the baseline.

    Of two agents that the arguments name, or that are of two runs that they name, the difference is the first minus the
    second. Of two that nobody named, such as all agents of a run, it is the later minus the earlier in the run's order,
    as in the report. Of several runs with the same agents, an agent is compared with itself in the other runs.

    Args:
        compared_agents: Agents from `read_compared_agents`.
        metrics: Numeric fields of a row, besides success and SPL.
        baseline: Name of the agent that all others are compared with.
        allow_differences: Compare what runs of different tasks or protocol have in common.

    Raises:
        InvalidArgumentError: There are fewer than two agents, their runs differ, or a name is unknown.
    """
    pairs = _pairs(compared_agents, baseline)
    names = _fields(compared_agents, metrics)
    found = [_compare(a, b, names, allow_differences) for a, b in pairs]
    adjusted: list[dict[str, PairedEffect]] = [dict(one.all.effects) for one in found]
    for field in names:
        there = [effects for effects in adjusted if field in effects]
        for effects, effect in zip(there, with_holm([effects[field] for effects in there]), strict=True):
            effects[field] = effect
    return [
        replace(one, parts=(replace(one.all, effects=effects), *one.parts[1:]))
        for one, effects in zip(found, adjusted, strict=True)
    ]


def check_metric(name: str) -> None:
    """Check that a field of a row can be averaged.

    Raises:
        InvalidArgumentError: It cannot, or there is none of that name.
    """
    numeric = [field.name for field in fields(StageMetrics) if any(kind in str(field.type) for kind in _NUMBERS)]
    if name not in numeric:
        raise InvalidArgumentError(f"metric {name!r} is none of {', '.join(sorted(numeric))}")


_NUMBERS = ("int", "float", "bool")


def comparison_json(comparisons: Sequence[Comparison]) -> dict[str, Any]:
    """Return all numbers, unrounded."""
    return {
        "schema_version": 1,
        "comparisons": [
            {
                "a": one.a,
                "b": one.b,
                "parts": [
                    {
                        **{key: getattr(part, key) for key in ("key", "n", "num_only_a", "num_only_b", "mcnemar_p")},
                        "effects": {
                            name: {**asdict(effect), "detectable": effect.detectable, "verdict": effect.verdict}
                            for name, effect in part.effects.items()
                        },
                    }
                    for part in one.parts
                ],
                "holm_p": {name: effect.adjusted_p for name, effect in one.all.effects.items()},
                "dropped": dict(one.dropped),
                "settings": {key: list(values) for key, values in one.settings.items()},
                "flips": [asdict(flip) for flip in one.flips],
            }
            for one in comparisons
        ],
    }


def _pairs(compared_agents: Sequence[ComparedAgent], baseline: str | None) -> list[tuple[ComparedAgent, ComparedAgent]]:
    if baseline is not None:
        first = [compared for compared in compared_agents if baseline in (compared.name, compared.agent)]
        if len(first) != 1:
            raise InvalidArgumentError(
                f"baseline {baseline!r} is none of {', '.join(compared.name for compared in compared_agents)}"
            )
        return [(first[0], compared) for compared in compared_agents if compared is not first[0]]
    pairs = [(a, b) if a.place == b.place else (b, a) for a, b in combinations(compared_agents, 2)]
    num_runs = len({compared.run.run_dir.resolve() for compared in compared_agents})
    # Two runs of the same six agents: the question is what the settings changed, agent by agent.
    if 1 < num_runs < len(compared_agents):
        same = [(a, b) for a, b in pairs if a.agent == b.agent]
        pairs = same or pairs
    if not pairs:
        names = ", ".join(compared.name for compared in compared_agents) or "nothing"
        raise InvalidArgumentError(f"two agents are needed to compare; these are {names}")
    return pairs


def _fields(compared_agents: Sequence[ComparedAgent], metrics: Sequence[str]) -> list[str]:
    if not any(compared.rows for compared in compared_agents):
        raise InvalidArgumentError(
            f"no recorded stage in {', '.join(str(compared.run.run_dir) for compared in compared_agents)}"
        )
    for name in metrics:
        check_metric(name)
    return list(dict.fromkeys([*METRICS, *metrics]))


def _compare(a: ComparedAgent, b: ComparedAgent, fields: Sequence[str], allow_differences: bool) -> Comparison:
    settings = config_differences(a, b)
    different = [key for key in settings if key.startswith(SAME_PROTOCOL)]
    if different and not allow_differences:
        differing = "; ".join(f"{key} {settings[key][1]} and {settings[key][0]}" for key in different)
        raise InvalidArgumentError(
            f"{b.name} and {a.name} were not run alike ({differing}); "
            "--allow-differences compares the stages that they have in common"
        )
    dropped: Counter[str] = Counter()
    pairs: list[tuple[StageMetrics, StageMetrics]] = []
    for key in sorted(_stages(a) | _stages(b)):
        reason = _reason(a, b, key, allow_differences)
        if reason == GUIDED:
            continue
        if reason is None:
            pairs.append((a.rows[key], b.rows[key]))
        else:
            dropped[reason] += 1
    if not pairs:
        reasons = ", ".join(f"{count} {reason}" for reason, count in dropped.items())
        raise InvalidArgumentError(f"{b.name} and {a.name} have no scored stage in common ({reasons or 'no stages'})")
    groups = {ALL: pairs}
    for field in ("stratum", "mode"):
        for pair in pairs:
            groups.setdefault(getattr(pair[0], field), []).append(pair)
    order = {ALL: "all", **STRATA, **MODES}
    parts = tuple(_part(key, order[key], groups[key], fields) for key in order if key in groups)
    flips = tuple(_flip(a, b, pair) for pair in pairs if pair[0].success is not pair[1].success)
    return Comparison(a.name, b.name, parts, dict(dropped.most_common()), flips, settings)


def _stages(compared: ComparedAgent) -> set[tuple[str, int]]:
    """Return the stages that the run consists of, recorded or not."""
    planned = {(task_id, stage) for task_id, num in compared.run.num_stages.items() for stage in range(1, num + 1)}
    return planned | compared.rows.keys()


def _reason(a: ComparedAgent, b: ComparedAgent, key: tuple[str, int], allow_differences: bool) -> str | None:
    """Return why a stage is not compared. Where differences are allowed, the house may have changed in other ways."""
    for compared in (a, b):
        if key not in compared.rows:
            is_foreign = key[0] not in compared.run.num_stages
            return f"{'no such task' if is_foreign else 'not run yet'} in {compared.name}"
        if compared.rows[key].success is None:
            state = compared.rows[key].state
            return GUIDED if state == GUIDED else f"{state.replace('_', ' ')} in {compared.name}"
    first, second = a.rows[key], b.rows[key]
    same = ("house", "category", "num_stages", *(() if allow_differences else ("stratum", "mode")))
    if any(getattr(first, name) != getattr(second, name) for name in same):
        return "another stage under the same name"
    return None


def _part(
    key: str, label: str, pairs: Sequence[tuple[StageMetrics, StageMetrics]], fields: Sequence[str]
) -> ComparedPart:
    by_missing: dict[tuple[int, ...], list[str]] = {}
    for field in fields:
        there = tuple(i for i, pair in enumerate(pairs) if all(getattr(row, field) is not None for row in pair))
        if there:
            by_missing.setdefault(there, []).append(field)
    effects: dict[str, PairedEffect] = {}
    for there, names in by_missing.items():
        values = np.array([[[float(getattr(row, name)) for name in names] for row in pairs[i]] for i in there])
        houses = [house_of(pairs[i][0]) for i in there]
        effects.update(zip(names, paired_effects(values[:, 0], values[:, 1], houses), strict=True))
    only_a = sum(bool(x.success) and not y.success for x, y in pairs)
    only_b = sum(bool(y.success) and not x.success for x, y in pairs)
    ordered = {name: effects[name] for name in fields if name in effects}
    return ComparedPart(key, label, len(pairs), only_a, only_b, mcnemar(only_a, only_b), ordered)


def _flip(a: ComparedAgent, b: ComparedAgent, pair: tuple[StageMetrics, StageMetrics]) -> Flip:
    winner, loser, row = (a, b, pair[1]) if pair[0].success else (b, a, pair[0])
    return Flip(
        task_id=row.task_id,
        stage=row.stage,
        category=row.category,
        stratum=row.stratum,
        mode=row.mode,
        winner=winner.name,
        loser=loser.name,
        cause=CAUSE_NAMES[FailureCause(row.cause)] if row.cause else "",
        pages=(_page(winner, row), _page(loser, row)),
        command=_view_command(winner, loser, row),
    )


def _page(compared: ComparedAgent, row: StageMetrics) -> str | None:
    for stage in (None, row.stage):
        path = compared.run.run_dir / VIEW_DIR / page_name(row.task_id, compared.agent, stage)
        if path.is_file():
            return f"{path.as_posix()}#stage={row.stage}&round=1"
    return None


def _view_command(a: ComparedAgent, b: ComparedAgent, row: StageMetrics) -> str:
    agents: dict[Path, list[str]] = {}
    for compared in (a, b):
        agents.setdefault(compared.run.run_dir, []).append(compared.agent)
    commands = (
        ["evonav", "view", str(run_dir), "--task", row.task_id, "--agent", ",".join(names), "--stage", str(row.stage)]
        for run_dir, names in agents.items()
    )
    return " && ".join(shlex.join(command) for command in commands)
