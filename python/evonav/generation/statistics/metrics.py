"""List the metrics over tasks, with their labels and the paper's values, and collect their numbers in little memory."""

from array import array
from collections import Counter, defaultdict
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from evonav.generation.statistics.task_summary import TaskSummary
from evonav.tasks.statistics import Metric, Range, Reweighting, Unit


def _metric(
    key: str,
    label: str,
    group: str,
    unit: Unit = "share",
    *,
    paper: float | None = None,
    expected: float | None = None,
    accepted: Range | None = None,
) -> Metric:
    """Return a metric over no tasks yet."""
    return Metric(
        key=key,
        label=label,
        group=group,
        unit=unit,
        n=0,
        raw=None,
        interval="bootstrap",
        paper=paper,
        expected=expected,
        accepted=accepted,
    )


_EVOLUTION, _GOALS, _OBJECTS, _TASKS = "Evolution", "Goals of stages 2 and on", "Objects", "Tasks"
_DURING = "Changes during stages"

# `paper`: Sec. 3.2 and its plot. `expected` of evolutions: binomial, K uniform on {3, 4, 5}. Other `expected`: a trial
# of Algorithm 1 in ProcTHOR-10k's mix, without images and rejected goals (docs/studies/task-statistics.md).
METRICS = (
    _metric("evolved_once", "tasks with an evolution", _EVOLUTION, paper=0.859, expected=0.8542),
    _metric("evolved_twice", "tasks with two or more", _EVOLUTION, paper=0.484, expected=0.4792),
    _metric("static", "static transitions", _EVOLUTION, paper=0.494, expected=0.5),
    _metric("unchanged", "triggered, but nothing moved", _EVOLUTION),
    _metric("mode_SALIENT_OBJECT", "by SALIENT_OBJECT", _EVOLUTION, paper=0.5),
    _metric("mode_RETAIN_GROUP", "by RETAIN_GROUP", _EVOLUTION, paper=0.4),
    _metric("mode_FULL_SHUFFLE", "by FULL_SHUFFLE", _EVOLUTION, paper=0.1),
    _metric("room_again", "same room as just before", _EVOLUTION, expected=0.036, accepted=(0.03, 0.05)),
    _metric("goal_relocated", "relocated before", _GOALS, paper=0.379, expected=0.39, accepted=(0.36, 0.41)),
    _metric("goal_in_changed_room", "in the room just changed", _GOALS, expected=0.795),
    _metric("goal_moved", "moved by the change", _GOALS, expected=0.685),
    _metric("goal_moved_SALIENT_OBJECT", "  if SALIENT_OBJECT", _GOALS, expected=0.575),
    _metric("goal_moved_RETAIN_GROUP", "  if RETAIN_GROUP", _GOALS, expected=0.795),
    _metric("goal_moved_FULL_SHUFFLE", "  if FULL_SHUFFLE", _GOALS, expected=0.8),
    _metric("goal_is_salient", "the salient object itself", _GOALS),
    _metric("goal_room_again", "in the previous goal's room", _GOALS),
    _metric("goal_again", "an earlier goal of the task", _GOALS),
    _metric("goal_relocated_all", "relocated before, all stages", _GOALS, expected=0.295),
    _metric("relocated_ratio", "median relocated ratio", _OBJECTS, "median share", accepted=(0.1, 0.2)),
    _metric("ratio_zero", "tasks with none relocated", _OBJECTS, expected=0.1458),
    _metric("ratio_above_80", "tasks above 80%", _OBJECTS),
    _metric("room_relocated", "relocated in changed room", _OBJECTS),
    _metric("room_relocated_SALIENT_OBJECT", "  if SALIENT_OBJECT", _OBJECTS),
    _metric("room_relocated_RETAIN_GROUP", "  if RETAIN_GROUP", _OBJECTS),
    _metric("room_relocated_FULL_SHUFFLE", "  if FULL_SHUFFLE", _OBJECTS),
    _metric("unmoved", "found no other place", _OBJECTS),
    _metric("unmoved_RETAIN_GROUP", "  if RETAIN_GROUP", _OBJECTS),
    _metric("unmoved_FULL_SHUFFLE", "  if FULL_SHUFFLE", _OBJECTS),
    _metric("during", "stages with a change", _DURING),
    _metric("during_target", "  that moved the target", _DURING),
    _metric("num_stages", "stages per task", _TASKS, "stages", paper=4.010, expected=4.0),
    _metric("goals_refused", "goals rejected per stage", _TASKS, "goals"),
)

RATIOS = tuple(metric for metric in METRICS if metric.unit != "median share")
"""Metrics that are ratios of sums over tasks."""
MEDIANS = tuple(metric for metric in METRICS if metric.unit == "median share")
"""Metrics that are medians of a quantity."""
OF_TASKS = ("evolved_once", "evolved_twice", "ratio_zero", "ratio_above_80")
"""Keys of metrics for which each task is one trial, so that Wilson's interval is valid."""

DISTRIBUTIONS = {
    "num_evolutions": "Evolutions per task",
    "modes": "Modes of evolutions",
    "modes_drawn": "Modes drawn, applied or not",
    "relocated_ratio": "Share of objects relocated by the end",
    "during_modes": "Modes of changes during stages",
    "outcomes": "Outcomes of transitions",
    "failures": "Reasons why a triggered change failed",
    "num_stages": "Stages per task",
    "num_rooms": "Rooms per house",
    "goal_rooms": "Rooms of goals",
    "goal_scores": "Target scores of goals",
    "goal_rejections": "Reasons for rejected goals",
    "house_rejections": "Reasons for houses without a task",
    "goal_categories": "Categories of goals",
    "house_categories": "Categories of objects",
}

QUANTITIES = {
    "relocated_ratio": ("Share of objects relocated by the end", "share"),
    "displacement_m": ("Displacement of relocated objects", "m"),
    "during_round": ("Round of changes during stages", "rounds"),
    "path_m": ("Reference path of a stage", "m"),
    "task_path_m": ("Reference path of a task", "m"),
    "reference_distance_m": ("Reference pose to target", "m"),
    "visible_px": ("Target in the reference image", "px"),
    "basic_words": ("Basic instruction", "words"),
    "appearance_words": ("Appearance instruction", "words"),
    "unified_words": ("Unified instruction", "words"),
    "num_rooms": ("Rooms per house", "rooms"),
    "num_objects": ("Objects per house", "objects"),
}

PAPER_EVOLUTIONS = (0.1458, 0.3750, 0.3333, 0.1250, 0.0208)
"""Computed shares of tasks with 0 to 4 evolutions; the paper gives 14.1% with none and 48.4% with two or more."""
PAPER_MODES = (0.5, 0.4, 0.1)
"""The paper's chances of the three modes."""


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
