"""Quantiles and sizes of weighted values."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray


def weighted_quantiles(
    values: NDArray[np.float64], weights: NDArray[np.float64], shares: Sequence[float]
) -> NDArray[np.float64]:
    """Return the least value that at least each share of the weight does not exceed; the mean of two where it is exact.

    With equal weights and share 0.5 this is the plain median.
    """
    order = np.argsort(values, kind="stable")
    ordered, cumulated = values[order], np.cumsum(weights[order])
    wanted = np.asarray(shares) * cumulated[-1]
    slack = 1e-9 * cumulated[-1]
    low = np.searchsorted(cumulated, wanted - slack)
    high = np.searchsorted(cumulated, wanted + slack)
    last = len(ordered) - 1
    return np.asarray((ordered[np.minimum(low, last)] + ordered[np.minimum(high, last)]) / 2)


def effective_size(weights: NDArray[np.float64]) -> float:
    """Return Kish's number of equally weighted units that tell as much: `(sum w)^2 / sum w^2`."""
    squares = float(np.square(weights).sum())
    return float(weights.sum()) ** 2 / squares if squares > 0 else 0.0
