"""Compute the statistics of a set of tasks in the paper's metrics (Sec. 3.2 and its plot of statistics)."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evonav.errors import TaskError
from evonav.generation.statistics.metrics import (
    DISTRIBUTIONS,
    MEDIANS,
    METRICS,
    OF_TASKS,
    PAPER_EVOLUTIONS,
    PAPER_MODES,
    QUANTITIES,
    RATIOS,
    Tally,
)
from evonav.generation.statistics.task_summary import MODES, RATIO_CLASSES, TaskSummary, read_summaries
from evonav.statistics import ClusterBootstrap, chi_square, effective_size, weighted_quantiles, wilson
from evonav.tasks.dataset import DATASET_NAME, read_dataset
from evonav.tasks.listing import task_roots
from evonav.tasks.statistics import (
    Distribution,
    Estimate,
    Metric,
    Quantity,
    Reweighting,
    TaskStatistics,
    Test,
    check_mix,
    reweight,
)

NUM_RESAMPLES = 2000


def statistics_of(
    summaries: Iterable[TaskSummary],
    *,
    sources: Sequence[str] = (),
    mix: str | None = None,
    house_rejections: Counter[str] | None = None,
) -> TaskStatistics:
    """Compute the statistics of a set of tasks, which is iterated once and not stored.

    Intervals resample houses, so that several tasks of one house (with other seeds) do not count as independent.

    Args:
        sources: Names of the sources, recorded in the result.
        mix: Data set to whose rooms the tasks are also reweighted (`evonav.tasks.statistics`).
        house_rejections: Number of houses without a task, by reason.

    Raises:
        TaskError: The set is empty.
        InvalidArgumentError: The mix is unknown, or contains no house of the set.
    """
    tally = Tally()
    for summary in summaries:
        tally.add(summary)
    if not tally.houses:
        raise TaskError("statistics: there is no task")
    if house_rejections:
        tally.counts_by_house["house_rejections"] = {(0, None): house_rejections}
    weighting = None if mix is None else reweight(mix, tally.num_rooms, tally.plans)
    return TaskStatistics(
        sources=tuple(sources),
        generators=tuple(sorted(tally.generators)),
        seeds=tuple(sorted(tally.seeds)),
        num_tasks=tally.num_tasks,
        num_houses=len(set(tally.houses)),
        num_stages=tally.num_stages,
        parameters=tuple(sorted(tally.parameters)),
        weighting=None if weighting is None else weighting.record,
        metrics=_metrics(tally, weighting),
        tests=_tests(tally, weighting),
        distributions=tuple(
            _distribution(tally, weighting, key, label)
            for key, label in DISTRIBUTIONS.items()
            if key in tally.counts_by_house
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
    """Compute the statistics of the tasks in folders.

    Args:
        mix: Data set to whose rooms the tasks are also reweighted, see `statistics_of`.
        num_workers: Number of processes that read tasks.
        on_task: Called with the number of read tasks and the number of all tasks.

    Raises:
        TaskError: A folder holds no task, or a task is malformed.
        InvalidArgumentError: The mix is unknown, or contains no house of the set.
    """
    check_mix(mix)
    roots = [root for folder in folders for root in task_roots(folder)]
    rejections: Counter[str] = Counter()
    for folder in folders:
        rejections.update(house_rejections(folder))

    def summaries() -> Iterator[TaskSummary]:
        for num_read, summary in enumerate(read_summaries(roots, num_workers=num_workers), start=1):
            yield summary
            on_task(num_read, len(roots))

    return statistics_of(summaries(), sources=[str(f) for f in folders], mix=mix, house_rejections=rejections)


def house_rejections(folder: Path) -> Counter[str]:
    """Count the houses without a task by reason, from `dataset.json`; empty if the file does not exist.

    Raises:
        TaskError: The file is malformed.
    """
    return read_dataset(folder).num_rejected if (folder / DATASET_NAME).is_file() else Counter()


def _metrics(tally: Tally, weighting: Reweighting | None) -> tuple[Metric, ...]:
    raw = _estimates(tally, None)
    reweighted = {} if weighting is None else _estimates(tally, weighting)
    sums = tally.ratio_rows().sum(axis=0)
    trials = {metric.key: round(n) for metric, n in zip(RATIOS, sums[:, 1], strict=True)}
    is_one_task_a_house = len(set(tally.houses)) == tally.num_tasks
    metrics = []
    for metric in METRICS:
        estimate = raw.get(metric.key)
        n = trials.get(metric.key, len(tally.values.get(metric.key, ())))
        is_wilson = estimate is not None and metric.unit == "share" and metric.key in OF_TASKS and is_one_task_a_house
        # Resampling gives no interval for events that never or always happened.
        is_wilson |= estimate is not None and metric.unit == "share" and estimate.value in (0.0, 1.0)
        if estimate is not None and is_wilson:
            estimate = Estimate(value=estimate.value, ci95=wilson(estimate.value * n, n))
        found = {
            "n": n,
            "raw": estimate,
            "interval": "wilson" if is_wilson else "bootstrap",
            "reweighted": reweighted.get(metric.key),
        }
        metrics.append(metric.model_copy(update=found))
    return tuple(metrics)


def _estimates(tally: Tally, weighting: Reweighting | None) -> dict[str, Estimate]:
    """Return values and bootstrap intervals by metric, without metrics of no data."""
    strata = None if weighting is None else weighting.task_strata
    houses = ClusterBootstrap(tally.houses, strata=strata, num_resamples=NUM_RESAMPLES)
    weights = np.ones(tally.num_tasks) if weighting is None else weighting.weights
    rows = tally.ratio_rows() * weights[:, None, None]
    found = {}
    for i, metric in enumerate(RATIOS):
        numerators, denominators = houses.sums(rows[:, i]).T
        ratio = houses.ratio(numerators, denominators, tally.num_tasks)
        if ratio.value is not None:
            found[metric.key] = Estimate(value=ratio.value, ci95=ratio.ci95)
    for metric in MEDIANS:
        values, tasks = tally.values_of(metric.key)
        median = houses.weighted_median(values, weights[tasks], houses.cluster_of[tasks])
        if median.value is not None:
            found[metric.key] = Estimate(value=median.value, ci95=median.ci95)
    return found


def _tests(tally: Tally, weighting: Reweighting | None) -> tuple[Test, ...]:
    """Test the numbers of evolutions and their modes against the generation parameters."""
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
    tally: Tally,
    weighting: Reweighting | None,
    key: str,
    cells: Sequence[str],
    expected: NDArray[np.float64],
    paper_shares: tuple[float, ...] | None,
) -> Test | None:
    counts = tally.counts_of(key)
    observed = [counts[cell] for cell in cells]
    result = chi_square(observed, expected.tolist())
    if result is None:
        return None
    reweighted_p = None
    if weighting is not None:
        shares = np.array([tally.weighted_counts_of(key, weighting)[cell] for cell in cells])
        # The effective sample size: the effective number of tasks times the average number of counts in a task.
        size = effective_size(weighting.weights) * sum(observed) / tally.num_tasks
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


_ORDERED = {
    "num_evolutions": None,
    "num_stages": None,
    "num_rooms": None,
    "relocated_ratio": RATIO_CLASSES,
    "modes": MODES,
    "modes_drawn": MODES,
}
"""Order of the names in a distribution, `None` for numeric order; other distributions are ordered by count."""


def _distribution(tally: Tally, weighting: Reweighting | None, key: str, label: str) -> Distribution:
    counts = tally.counts_of(key)
    if key not in _ORDERED:
        names = [name for name, _ in sorted(counts.items(), key=lambda item: (-item[1], item[0]))]
    elif key == "num_evolutions":
        names = [str(i) for i in range(len(tally.expected_evolutions))]
    else:
        names = list(_ORDERED[key] or sorted(counts, key=int))
    shares = None
    if weighting is not None and key != "house_rejections":
        weighted = tally.weighted_counts_of(key, weighting)
        total = sum(weighted.values())
        shares = tuple(weighted[name] / total for name in names) if total else None
    return Distribution(
        key=key, label=label, names=tuple(names), counts=tuple(counts[name] for name in names), reweighted_shares=shares
    )


def _quantity(tally: Tally, weighting: Reweighting | None, key: str, label: str, unit: str) -> Quantity:
    values, tasks = tally.values_of(key)
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
