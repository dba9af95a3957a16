"""What a stage cost: time by component, questions, tokens, money and memory. None of it is part of a record."""

import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Literal

Part = Literal["simulation", "perception", "agent"]

LEVELS = ("agent_peak_rss_mb",)
"""Fields that are no sums: what an agent's process says of them is not taken off what it said before."""


@dataclass(frozen=True, kw_only=True)
class StageCosts:
    """Of one stage; `None` where it was not measured. CPU time is of the evaluator's and the agent's processes."""

    wall_s: float | None = None
    cpu_s: float | None = None
    simulation_wall_s: float | None = None
    """Loading the house, rendering, moving, and planning paths."""
    simulation_cpu_s: float | None = None
    perception_wall_s: float | None = None
    """Detections and visible occupancy."""
    perception_cpu_s: float | None = None
    agent_wall_s: float | None = None
    """Asking the agent, its decision model and the way there and back included."""
    agent_cpu_s: float | None = None
    decision_wall_s: float | None = None
    """Of that, in its decision model."""
    decision_cpu_s: float | None = None
    evaluator_wall_s: float | None = None
    """All else: judging, recording, the map of the house."""
    evaluator_cpu_s: float | None = None
    num_questions: int | None = None
    """That a model was asked, tries included; `None` for a decision model that keeps no account."""
    num_replayed: int | None = None
    """Answered by kept exchanges."""
    input_tokens: int | None = None
    output_tokens: int | None = None
    cost_usd: float | None = None
    """By the prices given; `None` without."""
    agent_peak_rss_mb: float | None = None
    """Of the agent's process, at its most so far: it serves many episodes."""
    num_retries: int | None = None


class Stopwatch:
    """Wall and CPU time by component; what is in none of them is the evaluator's."""

    def __init__(self, cpu_s: Callable[[], float] = time.process_time) -> None:
        """Starts.

        Args:
            cpu_s: CPU time so far, of all processes that count.
        """
        self._clock = cpu_s
        self._spent_s: defaultdict[str, list[float]] = defaultdict(lambda: [0.0, 0.0])
        self._begun_s = (time.perf_counter(), cpu_s())

    @contextmanager
    def timing(self, part: Part) -> Iterator[None]:
        """Books what happens inside; not to be nested."""
        wall_s, cpu_s = time.perf_counter(), self._clock()
        try:
            yield
        finally:
            spent_s = self._spent_s[part]
            spent_s[0] += time.perf_counter() - wall_s
            spent_s[1] += self._clock() - cpu_s

    def costs(self, told: Mapping[str, float] | None = None) -> StageCosts:
        """All of it until now.

        Args:
            told: More of the stage, by field of `StageCosts`.
        """
        wall_s, cpu_s = time.perf_counter() - self._begun_s[0], self._clock() - self._begun_s[1]
        parts: dict[str, float] = {}
        for part in ("simulation", "perception", "agent"):
            parts[f"{part}_wall_s"], parts[f"{part}_cpu_s"] = self._spent_s[part]
        parts["evaluator_wall_s"] = wall_s - sum(spent_s[0] for spent_s in self._spent_s.values())
        parts["evaluator_cpu_s"] = cpu_s - sum(spent_s[1] for spent_s in self._spent_s.values())
        return StageCosts(wall_s=wall_s, cpu_s=cpu_s, **parts, **(told or {}))  # type: ignore[arg-type]
