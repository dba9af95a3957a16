import math
from random import Random

import numpy as np
import pytest

from evonav.statistics import ClusterBootstrap, widened_tail, wilson


def test_houses_are_resampled() -> None:
    """Against a plain loop, and wider than if stages were independent."""
    random = Random(3)
    houses = [f"h{i}" for i in range(12) for _ in range(random.choice((3, 4, 5)))]
    level = {house: random.random() for house in houses}
    values = np.array([[float(random.random() < level[house]), level[house]] for house in houses])
    found = ClusterBootstrap(houses).column_means(values)
    assert [one.value for one in found] == pytest.approx(values.mean(axis=0).tolist())
    assert {(one.n, one.num_clusters) for one in found} == {(len(houses), 12)}
    names = sorted(set(houses))
    rows = {name: values[[i for i, house in enumerate(houses) if house == name]] for name in names}
    means = [np.concatenate([rows[random.choice(names)] for _ in names]).mean(axis=0) for _ in range(10_000)]
    tail = widened_tail(12)
    ends = np.array([one.ci95 for one in found])
    assert ends == pytest.approx(np.quantile(means, [tail, 1 - tail], axis=0).T, abs=0.03)
    alone = np.array([one.ci95 for one in ClusterBootstrap([str(i) for i in range(len(houses))]).column_means(values)])
    assert np.ptp(ends[1]) > np.ptp(alone[1])
    assert ClusterBootstrap(houses).column_means(values) == found  # nothing is left to chance


def test_a_mean_is_a_ratio_of_sums() -> None:
    """Whichever way a command asks, it gets the same interval."""
    houses = ["b", "a", "b", "c", "a"]
    values = np.array([1.0, 0.0, 1.0, 0.25, 1.0])
    bootstrap = ClusterBootstrap(houses)
    (mean,) = bootstrap.column_means(values[:, None])
    ratio = bootstrap.ratio(bootstrap.sums(values), bootstrap.sums(np.ones(5)), 5)
    assert (mean.n, mean.num_clusters) == (ratio.n, ratio.num_clusters) == (5, 3)
    assert mean.value == pytest.approx(ratio.value)
    assert mean.ci95 == pytest.approx(ratio.ci95)
    one = bootstrap.ratio(bootstrap.sums(values), bootstrap.sums(np.full(5, 4.0)), 5, np.sqrt)
    assert one.value == pytest.approx(math.sqrt(0.65 / 4))
    assert ratio.ci95 is not None
    assert one.ci95 == pytest.approx(tuple(math.sqrt(end / 4) for end in ratio.ci95), abs=1e-3)


def test_resamples_keep_the_size_of_every_stratum() -> None:
    strata = np.array([0, 1, 1, 1, 0, 2])
    draws = ClusterBootstrap(list("abcdef"), strata=strata, num_resamples=50, seed=1).draws
    assert draws.shape == (50, 6)
    for stratum, size in ((0, 2), (1, 3), (2, 1)):
        assert (draws[:, strata == stratum].sum(axis=1) == size).all()
    assert len({tuple(row) for row in draws}) > 10


def test_it_agrees_with_wilson_and_leaves_out_what_is_not_there() -> None:
    num, successes = 400, 120
    hits = np.zeros(num)
    hits[:successes] = 1
    bootstrap = ClusterBootstrap([f"{i:03}" for i in range(num)], num_resamples=2000)
    found = bootstrap.ratio(hits, np.ones(num), num)
    assert found.ci95 == pytest.approx(wilson(successes, num), abs=0.006)
    assert bootstrap.ratio(hits, np.zeros(num), 0).value is None


def test_few_houses_widen_ratios_and_medians() -> None:
    """Plain percentiles of eight houses leave 1 in 40 out at either end; these leave out far less."""
    values = np.arange(8.0)
    bootstrap = ClusterBootstrap([str(i) for i in range(8)])
    found = bootstrap.ratio(values, np.ones(8), 8)
    drawn = bootstrap.resampled_sums(values) / 8
    plain = np.quantile(drawn, [0.025, 0.975])
    assert found.ci95 is not None
    assert found.ci95[0] < plain[0] - 0.3
    assert found.ci95[1] > plain[1] + 0.3
    median = bootstrap.weighted_median(values, np.ones(8), bootstrap.cluster_of)
    assert median.resampled is not None
    assert median.ci95 == tuple(np.quantile(median.resampled, [widened_tail(8), 1 - widened_tail(8)]))
    assert median.ci95 != tuple(np.quantile(median.resampled, [0.025, 0.975]))


def test_a_median_is_covered_about_as_often_as_it_says() -> None:
    generator = np.random.Generator(np.random.PCG64(3))
    num_covered = 0
    for seed in range(200):
        values = generator.exponential(size=60)
        bootstrap = ClusterBootstrap([f"{i:02}" for i in range(60)], num_resamples=300, seed=seed)
        found = bootstrap.weighted_median(values, np.ones(60), bootstrap.cluster_of)
        assert found.ci95 is not None
        num_covered += found.ci95[0] <= math.log(2) <= found.ci95[1]
    assert 0.88 <= num_covered / 200 <= 1.0


def test_differences_are_taken_within_resamples() -> None:
    bootstrap = ClusterBootstrap(list("abcdefgh"))
    low, ones = np.arange(8.0), np.ones(8)
    one, other = bootstrap.ratio(low, ones, 8), bootstrap.ratio(low + 2, ones, 9)
    gap = other.minus(one)
    assert (gap.value, gap.ci95, gap.n) == (2.0, None, 8)  # every house says the same
    mixed = bootstrap.ratio(low[::-1].copy(), ones, 8).minus(one)
    assert mixed.value == 0.0
    assert mixed.ci95 is not None
    assert mixed.ci95[0] < 0 < mixed.ci95[1]
    assert bootstrap.ratio(low, 0 * ones, 0).minus(one).value is None
