"""Score a perception beyond its detections: confidence, depth, pose, features, and the memory made from it."""

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from evonav.perception_benchmark.records import DISTANCE_BINS_M, NUM_COSINE_BINS, MemoryState, TaskRecord
from evonav.statistics import ClusterBootstrap, Estimate

NUM_CONFIDENCE_BINS = 10
_STARTS = tuple(f"{low:g}" for low in DISTANCE_BINS_M)
DISTANCES = (*(f"{a}-{b} m" for a, b in pairwise(_STARTS)), f"over {_STARTS[-1]} m")
COSINES = ("same_object", "same_category", "other", "text_own", "text_other")


Measures = Mapping[str, Estimate]
"""Estimates by the name of the metric."""


def calibration(
    houses: ClusterBootstrap, confidences: NDArray[np.float64], is_right: NDArray[np.bool_], of: NDArray[np.int64]
) -> tuple[dict[str, Estimate], list[tuple[float, Estimate]]]:
    """Return expected calibration error, and mean confidence and precision by tenths of confidence.

    Confidence, whether it is right, and house of each of the detections that count have shape `(D,)`.
    """
    bins = np.minimum((confidences * NUM_CONFIDENCE_BINS).astype(np.int64), NUM_CONFIDENCE_BINS - 1)
    tops, sums, counts = np.zeros((3, NUM_CONFIDENCE_BINS, houses.num_clusters))
    rows: list[tuple[float, Estimate]] = []
    for i in range(NUM_CONFIDENCE_BINS):
        mine = bins == i
        tops[i], sums[i] = houses.sums(is_right[mine], of[mine]), houses.sums(confidences[mine], of[mine])
        counts[i] = houses.sums(np.ones(int(mine.sum())), of[mine])
        if mine.any():
            rows.append((float(confidences[mine].mean()), houses.ratio(tops[i], counts[i], int(mine.sum()))))
    num = len(confidences)
    if num == 0:
        return {"ece": Estimate(None, None, 0, houses.num_clusters)}, rows
    value = float(np.abs(tops.sum(axis=1) - sums.sum(axis=1)).sum() / num)
    errors = np.abs(houses.resampled_sums((tops - sums).T)).sum(axis=1)
    resampled = errors / np.maximum(houses.resampled_sums(counts.sum(axis=0)), 1.0)
    return {"ece": houses.estimate(value, resampled, num)}, rows


def depth_groups(houses: ClusterBootstrap, records: Sequence[TaskRecord]) -> dict[str, Measures]:
    """Depth errors over all pixels, `all`, then by their true depth."""
    num, lost, relative, square = (
        np.array([getattr(record.depth, name) for record in records], np.float64).reshape(len(records), -1)
        for name in ("num", "num_lost", "relative", "square_m2")
    )

    def group(columns: slice) -> Measures:
        all_px, lost_px, relatives, squares = (table[:, columns].sum(axis=1) for table in (num, lost, relative, square))
        with_depth = houses.sums(all_px - lost_px)
        return {
            "depth_relative": houses.rate(relatives, all_px - lost_px),
            "depth_rmse_m": houses.ratio(houses.sums(squares), with_depth, int(with_depth.sum()), np.sqrt),
            "depth_lost": houses.rate(lost_px, all_px),
        }

    return {"all": group(slice(None))} | {name: group(slice(i, i + 1)) for i, name in enumerate(DISTANCES)}


def pose(houses: ClusterBootstrap, records: Sequence[TaskRecord]) -> dict[str, Estimate]:
    """Return the mean errors of the believed pose."""
    nums = [len(record.pose.offset_m) for record in records]
    turns_deg = [float(np.degrees(sum(record.pose.turn_rad))) for record in records]
    return {
        "pose_offset_m": houses.rate([sum(record.pose.offset_m) for record in records], nums),
        "pose_turn_deg": houses.rate(turns_deg, nums),
    }


def cosines(
    houses: ClusterBootstrap, records: Sequence[TaskRecord]
) -> tuple[dict[str, list[int]], dict[str, Estimate]]:
    """Return histograms of cosines, and their means; nothing without features."""
    counts: dict[str, list[int]] = {}
    estimates: dict[str, Estimate] = {}
    features = [record.features for record in records]
    for name in COSINES:
        table = np.zeros((len(records), NUM_COSINE_BINS))
        for i, one in enumerate(features):
            table[i] = getattr(one, name) or 0
        if table.any():
            counts[name] = table.sum(axis=0).astype(np.int64).tolist()
            estimates[f"cosine_{name}"] = houses.rate(
                [one.totals.get(name, 0.0) for one in features], table.sum(axis=1)
            )
    if any(one.num_texts for one in features):
        estimates["text_right"] = houses.rate([one.num_right for one in features], [one.num_texts for one in features])
    return counts, estimates


def memory(houses: ClusterBootstrap, records: Sequence[TaskRecord]) -> dict[str, Estimate]:
    """Score the object map after the first house's tour, and its stale entries in the next house."""
    first = [_states(record, 0, 1.0) for record in records]
    begun, toured = ([_states(record, 1, share) for record in records] for share in (0.0, 1.0))
    return {
        **memory_measures(houses, first),
        "stale_at_start": _share(houses, begun, "num_stale", lambda state: state.num_entries),
        "stale_after_tour": _share(houses, toured, "num_stale", lambda state: state.num_entries),
    }


def memory_curve(houses: ClusterBootstrap, records: Sequence[TaskRecord]) -> list[tuple[float, dict[str, Estimate]]]:
    """Score the object map by share of the first house's tour, where all tasks have a state."""
    shares = sorted({state.share for record in records for state in record.memory if state.stage == record.stages[0]})
    found = []
    for share in shares:
        states = [_states(record, 0, share) for record in records]
        if all(states):
            found.append((share, memory_measures(houses, states)))
    return found


def memory_measures(houses: ClusterBootstrap, states: Sequence[MemoryState | None]) -> dict[str, Estimate]:
    """Score the memory at one time, from one state per task."""
    is_there = [float(state is not None) for state in states]

    def per_task(name: str) -> Estimate:
        return houses.rate([getattr(state, name, 0.0) for state in states], is_there)

    return {
        "entries": per_task("num_entries"),
        "seen": per_task("num_seen"),
        "memory_precision": _share(houses, states, "num_right", lambda state: state.num_entries),
        "memory_recall": _share(houses, states, "num_seen_held", lambda state: state.num_seen),
        "position_error_m": _share(houses, states, "error_m", lambda state: state.num_error),
        "surplus": _share(houses, states, "num_surplus", lambda state: state.num_objects),
        "wrong_label": _share(houses, states, "num_wrong_label", lambda state: state.num_entries - state.num_phantoms),
        "phantoms": _share(houses, states, "num_phantoms", lambda state: state.num_entries),
    }


def _share(
    houses: ClusterBootstrap, states: Sequence[MemoryState | None], name: str, of: Callable[[MemoryState], float]
) -> Estimate:
    return houses.rate(
        [getattr(state, name, 0.0) for state in states], [of(state) if state else 0.0 for state in states]
    )


def _states(record: TaskRecord, house: int, share: float) -> MemoryState | None:
    """Return the memory in a house of the tour, after a share of it."""
    if house >= len(record.stages):
        return None
    stage = record.stages[house]
    return next((state for state in record.memory if state.stage == stage and state.share == share), None)
