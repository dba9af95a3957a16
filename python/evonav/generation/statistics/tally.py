"""Collect the numbers of many tasks in little memory."""

from array import array
from collections import Counter, defaultdict
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from evonav.generation.statistics.metrics import RATIOS
from evonav.generation.statistics.task_summary import TaskSummary
from evonav.tasks.statistics import Reweighting


@dataclass
class Tally:
    """The collected tasks: one row of sums a task, counts by kind of house, and the values of quantities."""

    rows: "array[float]" = field(default_factory=lambda: array("d"))
    """Numerator and denominator of each of `RATIOS`, for each task."""
    houses: list[str] = field(default_factory=list)
    num_rooms: list[int] = field(default_factory=list)
    plans: list[str | None] = field(default_factory=list)
    counts_by_house: dict[str, dict[tuple[int, str | None], Counter[str]]] = field(default_factory=dict)
    """Counts by distribution, then by number of rooms and plan, which determine a task's weight."""
    values: "dict[str, array[float]]" = field(default_factory=dict)
    tasks_of_values: "dict[str, array[int]]" = field(default_factory=dict)
    expected_evolutions: list[float] = field(default_factory=list)
    expected_modes: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    seeds: set[int] = field(default_factory=set)
    generators: set[str] = field(default_factory=set)
    parameters: set[str] = field(default_factory=set)
    num_stages: int = 0

    @property
    def num_tasks(self) -> int:
        """Number of collected tasks."""
        return len(self.houses)

    def add(self, summary: TaskSummary) -> None:
        """Add a task."""
        task = self.num_tasks
        self.houses.append(summary.house_sha256)
        self.num_rooms.append(summary.num_rooms)
        self.plans.append(summary.plan)
        for metric in RATIOS:
            self.rows.extend(summary.sums.get(metric.key, (0.0, 0.0)))
        for key, counts in summary.counts.items():
            by_house = self.counts_by_house.setdefault(key, {})
            by_house.setdefault((summary.num_rooms, summary.plan), Counter()).update(counts)
        for key, values in summary.values.items():
            self.values.setdefault(key, array("d")).extend(values)
            self.tasks_of_values.setdefault(key, array("q")).extend([task] * len(values))
        num_cells = max(len(self.expected_evolutions), len(summary.expected_evolutions))
        self.expected_evolutions += [0.0] * (num_cells - len(self.expected_evolutions))
        for i, chance in enumerate(summary.expected_evolutions):
            self.expected_evolutions[i] += chance
        num_evolved = sum(summary.counts.get("modes", Counter()).values())
        self.expected_modes += num_evolved * np.array(summary.expected_modes)
        self.seeds.add(summary.seed)
        self.generators.add(summary.generator)
        self.parameters.add(summary.parameters)
        self.num_stages += summary.num_stages

    def ratio_rows(self) -> NDArray[np.float64]:
        """Return the numerator and denominator of each ratio, `(tasks, ratios, 2)`."""
        return np.frombuffer(self.rows).reshape(-1, len(RATIOS), 2)

    def values_of(self, key: str) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Return the values of a quantity, and the index of each value's task."""
        return np.frombuffer(self.values[key]), np.frombuffer(self.tasks_of_values[key], dtype=np.int64)

    def counts_of(self, key: str) -> Counter[str]:
        """Return the counts of a distribution."""
        total: Counter[str] = Counter()
        for counts in self.counts_by_house.get(key, {}).values():
            total.update(counts)
        return total

    def weighted_counts_of(self, key: str, weighting: Reweighting) -> dict[str, float]:
        """Return the counts of a distribution, weighted by task."""
        weights = {
            kind: float(weight)
            for kind, weight in zip(zip(self.num_rooms, self.plans, strict=True), weighting.weights, strict=True)
        }
        total: dict[str, float] = defaultdict(float)
        for kind, counts in self.counts_by_house.get(key, {}).items():
            for name, count in counts.items():
                total[name] += weights.get(kind, 0.0) * count
        return total
