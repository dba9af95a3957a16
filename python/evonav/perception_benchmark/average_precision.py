"""COCO's average precision, with intervals by house.

Lin et al., "Microsoft COCO", ECCV 2014; 101-point interpolation as in its reference code: precision at a recall is the
best at that recall or a higher one, 0 where the recall is not reached, and AP is the mean over 0, 0.01, .. 1.
"""

import numpy as np
from numpy.typing import NDArray

RECALLS = np.linspace(0.0, 1.0, 101)
_MAX_CELLS = 4_000_000


def interpolated(confidences: NDArray[np.float64], is_right: NDArray[np.bool_], num_true: int) -> NDArray[np.float64]:
    """Return the interpolated precision at `RECALLS`, `(101,)`.

    Args:
        confidences: `(D,)`; of equal ones the first comes first.
        is_right: `(D,)` whether a detection has a partner.
        num_true: Objects that were to be found, at least 1.
    """
    order = np.argsort(-confidences, kind="stable")
    right = np.cumsum(is_right[order]).astype(np.float64)
    precision = right / np.arange(1, len(order) + 1)
    envelope = np.maximum.accumulate(precision[::-1])[::-1]
    places = np.searchsorted(right / num_true, RECALLS, side="left")
    return np.append(envelope, 0.0)[places]


def resampled(
    confidences: NDArray[np.float64],
    is_right: NDArray[np.bool_],
    units: NDArray[np.int64],
    num_true: NDArray[np.float64],
    draws: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return AP in resamples of units.

    Args:
        confidences: `(D,)`.
        is_right: `(D,)`.
        units: `(D,)` unit of each detection.
        num_true: `(U,)` objects of each unit.
        draws: `(R, U)` how often each unit is drawn.

    Returns:
        `(R,)`; NaN where a resample has no object.
    """
    order = np.argsort(-confidences, kind="stable")
    is_right, units = is_right[order], units[order]
    wanted = draws @ num_true
    values = np.full(len(draws), np.nan)
    block = max(1, _MAX_CELLS // max(1, len(order)))
    for start in range(0, len(draws), block):
        rows = slice(start, min(start + block, len(draws)))
        weights = draws[rows][:, units]
        values[rows] = _block(weights, is_right, wanted[rows])
    return values


def _block(
    weights: NDArray[np.float64], is_right: NDArray[np.bool_], wanted: NDArray[np.float64]
) -> NDArray[np.float64]:
    num_rows, num = weights.shape
    if num == 0:
        return np.where(wanted > 0, 0.0, np.nan)
    right, seen = np.cumsum(weights * is_right, axis=1), np.cumsum(weights, axis=1)
    precision = np.divide(right, seen, out=np.zeros_like(right), where=seen > 0)
    envelope = np.maximum.accumulate(precision[:, ::-1], axis=1)[:, ::-1]
    recall = right / np.maximum(wanted, 1.0)[:, None]
    # One search for all rows: row i's recalls, 0..1, are put at 2i..2i+1, less what that costs in digits.
    shift = 2.0 * np.arange(num_rows)[:, None]
    places = np.searchsorted((recall + shift).ravel(), (RECALLS[None, :] + shift - 1e-9).ravel(), side="left")
    columns = places.reshape(num_rows, -1) - num * np.arange(num_rows)[:, None]
    padded = np.concatenate([envelope, np.zeros((num_rows, 1))], axis=1)
    columns = np.clip(columns, 0, num)
    at_recalls = np.take_along_axis(padded, columns, axis=1).mean(axis=1)
    return np.asarray(np.where(wanted > 0, at_recalls, np.nan))
