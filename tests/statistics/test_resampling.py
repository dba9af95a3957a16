"""Draws of clusters by the core against NumPy's own."""

import numpy as np
import pytest

from evonav import _core


@pytest.mark.parametrize("num_clusters", [1, 2, 3, 7, 24, 101, 256, 1000, 3000])
@pytest.mark.parametrize("seed", [0, 1, 12345])
def test_the_core_draws_what_numpy_draws(num_clusters: int, seed: int) -> None:
    bits = np.random.PCG64(seed)
    stream = bits.state["state"]
    num_resamples = max(50, 300_000 // num_clusters)
    shares = np.full(num_clusters, 1 / num_clusters)
    expected = np.random.Generator(bits).multinomial(num_clusters, shares, size=num_resamples)
    counts, state = _core.draw_counts(
        stream["state"], stream["inc"], num_clusters=num_clusters, num_resamples=num_resamples
    )
    assert counts.dtype == np.uint8
    assert np.array_equal(counts, expected)
    assert state == bits.state["state"]["state"]  # the next stratum's draws go on from here
