"""What a set of tasks is like, in the paper's own measures (Sec. 3.2, its figure of statistics)."""

from array import array
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evonav.errors import TaskError
from evonav.generation.statistics.metrics import (
    DISTRIBUTIONS,
    MEASURES,
    PAPER_EVOLUTIONS,
    PAPER_MODES,
    QUANTITIES,
)
from evonav.generation.statistics.room_mix import Reweighting, check_mix, reweight
from evonav.generation.statistics.task_summary import MODES, RATIO_CLASSES, TaskFacts, read_all_facts
from evonav.statistics import ClusterBootstrap, chi_square, effective_size, weighted_quantiles, wilson
from evonav.tasks.dataset import DATASET_NAME, read_dataset
from evonav.tasks.listing import task_roots
from evonav.tasks.statistics import (
    Distribution,
    Estimate,
    Metric,
    Quantity,
    Stratum,
    TaskStatistics,
    Test,
    Weighting,
)

NUM_RESAMPLES = 2000
_RATIOS = tuple(info for info in MEASURES if info.unit != "median share")
_MEDIANS = tuple(info for info in MEASURES if info.unit == "median share")


@dataclass
class _Tally:
    """Tasks taken in so far: a row of sums each, counts by kind of house, and quantities as bare numbers."""

    rows: "array[float]" = field(default_factory=lambda: array("d"))
    """Per task, numerator and denominator of each of `_RATIOS`."""
    houses: list[str] = field(default_factory=list)
    num_rooms: list[int] = field(default_factory=list)
    plans: list[str | None] = field(default_factory=list)
    counts: dict[str, dict[tuple[int, str | None], Counter[str]]] = field(default_factory=dict)
    """By distribution, then by kind of house: all that a task's weight depends on."""
    values: "dict[str, array[float]]" = field(default_factory=dict)
    tasks_of_values: "dict[str, array[int]]" = field(default_factory=dict)
    expected_evolutions: list[float] = field(default_factory=list)
    expected_modes: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    seeds: set[int] = field(default_factory=set)
    generators: set[str] = field(default_factory=set)
    parameters: set[str] = field(default_factory=set)
    num_stages: int = 0

    def take(self, facts: TaskFacts) -> None:
        """Adds a task."""
        task = len(self.houses)
        self.houses.append(facts.house_sha256)
        self.num_rooms.append(facts.num_rooms)
        self.plans.append(facts.plan)
        for info in _RATIOS:
            self.rows.extend(facts.sums.get(info.key, (0.0, 0.0)))
        for key, counts in facts.counts.items():
            by_house = self.counts.setdefault(key, {})
            by_house.setdefault((facts.num_rooms, facts.plan), Counter()).update(counts)
        for key, values in facts.values.items():
            self.values.setdefault(key, array("d")).extend(values)
            self.tasks_of_values.setdefault(key, array("q")).extend([task] * len(values))
        num_cells = max(len(self.expected_evolutions), len(facts.expected_evolutions))
        self.expected_evolutions += [0.0] * (num_cells - len(self.expected_evolutions))
        for i, chance in enumerate(facts.expected_evolutions):
            self.expected_evolutions[i] += chance
        num_evolved = sum(facts.counts.get("modes", Counter()).values())
        self.expected_modes += num_evolved * np.array(facts.expected_modes)
        self.seeds.add(facts.seed)
        self.generators.add(facts.generator)
        self.parameters.add(facts.parameters)
        self.num_stages += facts.num_stages


def statistics_of(
    facts: Iterable[TaskFacts],
    *,
    sources: Sequence[str] = (),
    mix: str | None = None,
    house_rejections: Counter[str] | None = None,
) -> TaskStatistics:
    """Statistics of a set of tasks, which is gone through once and not kept.

    Intervals resample houses, so that several tasks of one house (other seeds) do not count as independent.

    Args:
        facts: Of each task.
        sources: Recorded.
        mix: Also reweight to this data set's rooms (`evonav.generation.statistics.room_mix`).
        house_rejections: Houses without a task, by reason.

    Raises:
        TaskError: There is no task.
        InvalidArgumentError: There is no such mix, or no house is of it.
    """
    tally = _Tally()
    for one in facts:
        tally.take(one)
    if not tally.houses:
        raise TaskError("statistics: there is no task")
    if house_rejections:
        tally.counts["house_rejections"] = {(0, None): house_rejections}
    weighting = None if mix is None else reweight(mix, tally.num_rooms, tally.plans)
    return TaskStatistics(
        sources=tuple(sources),
        generators=tuple(sorted(tally.generators)),
        seeds=tuple(sorted(tally.seeds)),
        num_tasks=len(tally.houses),
        num_houses=len(set(tally.houses)),
        num_stages=tally.num_stages,
        parameters=tuple(sorted(tally.parameters)),
        weighting=None if weighting is None else _weighting(weighting),
        measures=_measures(tally, weighting),
        tests=_tests(tally, weighting),
        distributions=tuple(
            _distribution(tally, weighting, key, label) for key, label in DISTRIBUTIONS.items() if key in tally.counts
        ),
        quantities=tuple(
            _quantity(tally, weighting, key, *label) for key, label in QUANTITIES.items() if key in tally.values
        ),
    )


def statistics_of_folders(
    folders: Sequence[Path],
    *,
    mix: str | None = None,
    num_workers: int = 1,
    on_task: Callable[[int, int], None] = lambda done, total: None,
) -> TaskStatistics:
    """Statistics of the tasks in some folders.

    Args:
        folders: Each holds one folder a task.
        mix: As for `statistics_of`.
        num_workers: Processes that read tasks.
        on_task: Told how many tasks are read, of how many.

    Raises:
        TaskError: A folder holds no task, or a task is malformed.
        InvalidArgumentError: As `statistics_of`.
    """
    check_mix(mix)
    roots = [root for folder in folders for root in task_roots(folder)]
    rejections: Counter[str] = Counter()
    for folder in folders:
        rejections.update(house_rejections(folder))

    def facts() -> Iterator[TaskFacts]:
        for done, one in enumerate(read_all_facts(roots, num_workers=num_workers), start=1):
            yield one
            on_task(done, len(roots))

    return statistics_of(facts(), sources=[str(f) for f in folders], mix=mix, house_rejections=rejections)


def house_rejections(folder: Path) -> Counter[str]:
    """Houses that gave no task, by reason, as generation records them beside the tasks; none where it does not.

    Raises:
        TaskError: The record is malformed.
    """
    return read_dataset(folder).num_rejected if (folder / DATASET_NAME).is_file() else Counter()


def _weighting(weighting: Reweighting) -> Weighting:
    strata = zip(weighting.strata, weighting.target_shares, weighting.task_shares, strict=True)
    return Weighting(
        mix=weighting.mix,
        by=weighting.by,
        covered_share=weighting.covered_share,
        num_left_out=int((weighting.task_strata < 0).sum()),
        effective_num_tasks=effective_size(weighting.weights),
        strata=tuple(Stratum(name=name, target_share=target, task_share=share) for name, target, share in strata),
    )


def _measures(tally: _Tally, weighting: Reweighting | None) -> tuple[Metric, ...]:
    raw = _estimates(tally, None)
    reweighted = {} if weighting is None else _estimates(tally, weighting)
    sums = _rows(tally).sum(axis=0)
    trials = {info.key: round(n) for info, n in zip(_RATIOS, sums[:, 1], strict=True)}
    is_one_task_a_house = len(set(tally.houses)) == len(tally.houses)
    measures = []
    for info in MEASURES:
        estimate = raw.get(info.key)
        n = trials.get(info.key, len(tally.values.get(info.key, ())))
        is_wilson = estimate is not None and info.unit == "share" and info.is_of_tasks and is_one_task_a_house
        # Resampling says nothing of what never, or always, happened.
        is_wilson |= estimate is not None and info.unit == "share" and estimate.value in (0.0, 1.0)
        if estimate is not None and is_wilson:
            estimate = Estimate(value=estimate.value, ci95=wilson(estimate.value * n, n))
        measures.append(
            Metric(
                key=info.key,
                label=info.label,
                group=info.group,
                unit=info.unit,
                n=n,
                raw=estimate,
                interval="wilson" if is_wilson else "bootstrap",
                reweighted=reweighted.get(info.key),
                paper=info.paper,
                expected=info.expected,
                accepted=info.accepted,
            )
        )
    return tuple(measures)


def _rows(tally: _Tally) -> NDArray[np.float64]:
    """`(tasks, ratios, 2)`."""
    return np.frombuffer(tally.rows).reshape(-1, len(_RATIOS), 2)


def _estimates(tally: _Tally, weighting: Reweighting | None) -> dict[str, Estimate]:
    """Values and bootstrap intervals by measure, without those of nothing."""
    strata = None if weighting is None else weighting.task_strata
    houses = ClusterBootstrap(tally.houses, strata=strata, num_resamples=NUM_RESAMPLES)
    weights = np.ones(len(tally.houses)) if weighting is None else weighting.weights
    rows = _rows(tally) * weights[:, None, None]
    found = {}
    for i, info in enumerate(_RATIOS):
        numerators, denominators = houses.sums(rows[:, i]).T
        ratio = houses.ratio(numerators, denominators, len(tally.houses))
        if ratio.value is not None:
            found[info.key] = Estimate(value=ratio.value, ci95=ratio.ci95)
    for info in _MEDIANS:
        values, tasks = _values(tally, info.key)
        median = houses.weighted_median(values, weights[tasks], houses.cluster_of[tasks])
        if median.value is not None:
            found[info.key] = Estimate(value=median.value, ci95=median.ci95)
    return found


def _values(tally: _Tally, key: str) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """A quantity's values, and the task of each."""
    return np.frombuffer(tally.values[key]), np.frombuffer(tally.tasks_of_values[key], dtype=np.int64)


def _tests(tally: _Tally, weighting: Reweighting | None) -> tuple[Test, ...]:
    """That evolutions and their modes are drawn as Θ says."""
    num_cells = len(tally.expected_evolutions)
    cells = tuple(str(i) for i in range(num_cells))
    is_papers = num_cells == len(PAPER_EVOLUTIONS)
    papers = PAPER_EVOLUTIONS if is_papers else None
    expected = np.array(tally.expected_evolutions)
    modes = tally.expected_modes
    tests = [
        _test(tally, weighting, "num_evolutions", cells, expected, papers),
        _test(tally, weighting, "modes", MODES, modes, PAPER_MODES),
    ]
    return tuple(test for test in tests if test is not None)


def _test(
    tally: _Tally,
    weighting: Reweighting | None,
    key: str,
    cells: Sequence[str],
    expected: NDArray[np.float64],
    paper_shares: tuple[float, ...] | None,
) -> Test | None:
    counts = _counts(tally, key)
    observed = [counts[cell] for cell in cells]
    result = chi_square(observed, expected.tolist())
    if result is None:
        return None
    reweighted_p = None
    if weighting is not None:
        shares = np.array([_weighted_counts(tally, weighting, key)[cell] for cell in cells])
        # As many as would tell as much: the tasks' effective number, and of each what they hold on average.
        size = effective_size(weighting.weights) * sum(observed) / len(tally.houses)
        reweighted = chi_square((shares / shares.sum() * size).tolist(), expected.tolist()) if shares.sum() else None
        reweighted_p = None if reweighted is None else reweighted.p
    return Test(
        key=key,
        label=DISTRIBUTIONS[key],
        cells=tuple(cells),
        observed=tuple(observed),
        expected_shares=tuple((expected / expected.sum()).tolist()),
        paper_shares=paper_shares,
        statistic=result.statistic,
        num_degrees=result.num_degrees,
        p=result.p,
        reweighted_p=reweighted_p,
    )


def _counts(tally: _Tally, key: str) -> Counter[str]:
    total: Counter[str] = Counter()
    for counts in tally.counts.get(key, {}).values():
        total.update(counts)
    return total


def _weighted_counts(tally: _Tally, weighting: Reweighting, key: str) -> dict[str, float]:
    weights = {
        kind: float(weight)
        for kind, weight in zip(zip(tally.num_rooms, tally.plans, strict=True), weighting.weights, strict=True)
    }
    total: dict[str, float] = defaultdict(float)
    for kind, counts in tally.counts.get(key, {}).items():
        for name, count in counts.items():
            total[name] += weights.get(kind, 0.0) * count
    return total


_ORDERED = {
    "num_evolutions": None,
    "num_stages": None,
    "num_rooms": None,
    "relocated_ratio": RATIO_CLASSES,
    "modes": MODES,
    "modes_drawn": MODES,
}
"""Distributions with an order of their own, `None` for that of numbers; the others go by count."""


def _distribution(tally: _Tally, weighting: Reweighting | None, key: str, label: str) -> Distribution:
    counts = _counts(tally, key)
    if key not in _ORDERED:
        names = [name for name, _ in sorted(counts.items(), key=lambda item: (-item[1], item[0]))]
    elif key == "num_evolutions":
        names = [str(i) for i in range(len(tally.expected_evolutions))]
    else:
        names = list(_ORDERED[key] or sorted(counts, key=int))
    shares = None
    if weighting is not None and key != "house_rejections":
        weighted = _weighted_counts(tally, weighting, key)
        total = sum(weighted.values())
        shares = tuple(weighted[name] / total for name in names) if total else None
    return Distribution(
        key=key, label=label, names=tuple(names), counts=tuple(counts[name] for name in names), reweighted_shares=shares
    )


def _quantity(tally: _Tally, weighting: Reweighting | None, key: str, label: str, unit: str) -> Quantity:
    values, tasks = _values(tally, key)
    spread = np.quantile(values, [0, 0.05, 0.25, 0.5, 0.75, 0.95, 1]).tolist()
    mean = median = None
    if weighting is not None and (weights := weighting.weights[tasks]).sum() > 0:
        mean = float(np.average(values, weights=weights))
        median = float(weighted_quantiles(values, weights, [0.5])[0])
    return Quantity(
        key=key,
        label=label,
        unit=unit,
        n=len(values),
        mean=float(values.mean()),
        quantiles=(spread[0], spread[1], spread[2], spread[3], spread[4], spread[5], spread[6]),
        reweighted_mean=mean,
        reweighted_median=median,
    )
