"""Measure the cost of a stage: time by component, questions, tokens, money and memory. Records do not contain it."""

import time
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Literal, get_args

Part = Literal["simulation", "perception", "agent"]

LEVELS = ("agent_peak_rss_mb",)
"""Fields that are no sums: a stage has the latest value of the agent's process, not the difference to before."""


@dataclass(frozen=True, kw_only=True)
class StageCosts:
    """The costs of one stage; `None` where not measured. CPU time covers the evaluator's and the agent's processes."""

    wall_s: float | None = None
    cpu_s: float | None = None
    simulation_wall_s: float | None = None
    """Loading the house, rendering, moving, and planning paths."""
    simulation_cpu_s: float | None = None
    perception_wall_s: float | None = None
    """Detections and visible occupancy."""
    perception_cpu_s: float | None = None
    agent_wall_s: float | None = None
    """The agent's answers, with its decision model and the transport of both."""
    agent_cpu_s: float | None = None
    decision_wall_s: float | None = None
    """The part of `agent_wall_s` that is spent in the decision model."""
    decision_cpu_s: float | None = None
    evaluator_wall_s: float | None = None
    """Everything else, such as judging and recording."""
    evaluator_cpu_s: float | None = None
    num_questions: int | None = None
    """Questions to a model, retries included; `None` for a decision model that does not count them."""
    num_replayed: int | None = None
    """Questions that were answered from the response cache."""
    input_tokens: int | None = None
    output_tokens: int | None = None
    cost_usd: float | None = None
    """The cost by the configured prices; `None` without prices."""
    agent_peak_rss_mb: float | None = None
    """Peak memory of the agent's process so far; the process serves many episodes."""
    num_retries: int | None = None


class _Share:
    """The time of one component: that inside its blocks, which must not be nested."""

    def __init__(self, cpu_s: Callable[[], float]) -> None:
        self._clock = cpu_s
        self.wall_s = self.cpu_s = 0.0
        self._begun_s = (0.0, 0.0)

    def __enter__(self) -> None:
        self._begun_s = (time.perf_counter(), self._clock())

    def __exit__(self, *_: object) -> None:
        wall_s, cpu_s = self._begun_s
        self.wall_s += time.perf_counter() - wall_s
        self.cpu_s += self._clock() - cpu_s


class Stopwatch:
    """Measures wall and CPU time by component; the rest is the evaluator's."""

    def __init__(self, cpu_s: Callable[[], float] = time.process_time) -> None:
        """Start the clock.

        Args:
            cpu_s: Returns the CPU time so far of all processes that count.
        """
        self._clock = cpu_s
        self._shares = {part: _Share(cpu_s) for part in get_args(Part)}
        self._begun_s = (time.perf_counter(), cpu_s())

    def timing(self, part: Part) -> AbstractContextManager[None]:
        """Count the time inside the block for a component. Blocks must not be nested."""
        return self._shares[part]

    def costs(self, others: Mapping[str, float] | None = None) -> StageCosts:
        """Return all costs until now.

        Args:
            others: More costs of the stage, by field of `StageCosts`.
        """
        wall_s, cpu_s = time.perf_counter() - self._begun_s[0], self._clock() - self._begun_s[1]
        parts: dict[str, float] = {}
        for part, share in self._shares.items():
            parts[f"{part}_wall_s"], parts[f"{part}_cpu_s"] = share.wall_s, share.cpu_s
        parts["evaluator_wall_s"] = wall_s - sum(share.wall_s for share in self._shares.values())
        parts["evaluator_cpu_s"] = cpu_s - sum(share.cpu_s for share in self._shares.values())
        return StageCosts(wall_s=wall_s, cpu_s=cpu_s, **parts, **(others or {}))  # type: ignore[arg-type]
