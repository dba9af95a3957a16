"""Score the probabilities that a memory gives for its entries."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

NUM_BINS = 10
"""Bins of the calibration error, of equal width."""
LEAST_P = 1e-6
"""Probabilities are kept this far from 0 and 1 in the logarithmic score."""


@dataclass(slots=True)
class BeliefSums:
    """Sums over entries with a `p_present`, at the first and the last answer of each visit.

    An entry is right if it is matched with an object, by the definition of *stale*.
    """

    n: int = 0
    squared_error: float = 0.0
    """Sum of (p - right)^2; by `n`, the Brier score (Brier, Monthly Weather Review 1950)."""
    log_loss: float = 0.0
    """Sum of -log of the probability given to what is so; by `n`, the NLL in nats."""
    bins: NDArray[np.float64] = field(default_factory=lambda: np.zeros((NUM_BINS, 3)))
    """`(NUM_BINS, 3)`: entries, sum of their probabilities, right ones."""

    def take(self, p_present: NDArray[np.float64], is_right: NDArray[np.bool_]) -> None:
        """Add entries.

        Args:
            p_present: `(N,)`, NaN where there is none.
            is_right: `(N,)`.
        """
        is_given = ~np.isnan(p_present)
        p, right = p_present[is_given], is_right[is_given].astype(np.float64)
        if not p.size:
            return
        self.n += len(p)
        self.squared_error += float(np.sum((p - right) ** 2))
        inside = np.clip(p, LEAST_P, 1.0 - LEAST_P)
        self.log_loss -= float(np.sum(np.where(right == 1.0, np.log(inside), np.log1p(-inside))))
        bins = np.minimum((p * NUM_BINS).astype(np.intp), NUM_BINS - 1)
        np.add.at(self.bins, bins, np.column_stack([np.ones(len(p)), p, right]))


def calibration_error(bins: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the expected calibration error: the mean distance of bin means from the share of right entries.

    Source: Naeini et al., AAAI 2015.

    Args:
        bins: `(..., NUM_BINS, 3)`, see `BeliefSums.bins`.

    Returns:
        `(...)`; NaN without entries.
    """
    total = bins[..., 0].sum(axis=-1)
    gap = np.abs(bins[..., 1] - bins[..., 2]).sum(axis=-1)
    error: NDArray[np.float64] = np.divide(gap, total, out=np.full_like(total, np.nan), where=total > 0)
    return error
