"""Compute scores from records of perceptions, each with its n and a 95% interval by house."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from evonav.errors import StoreError
from evonav.perception_benchmark import other_scores as other
from evonav.perception_benchmark.average_precision import interpolated, resampled
from evonav.perception_benchmark.matching import IGNORED, IOU_LIMIT, NONE
from evonav.perception_benchmark.other_scores import Measures
from evonav.perception_benchmark.records import DISTANCE_BINS_M, TaskRecord
from evonav.statistics import ClusterBootstrap, Estimate

NUM_RESAMPLES = 2000
NUM_AP_RESAMPLES = 300
SIZE_LIMITS = (32 * 32 / (640 * 480), 96 * 96 / (640 * 480))
"""COCO's small and medium objects end here, as parts of an image: its images are mostly of 640 x 480 pixels."""
SIZES = ("small", "medium", "large")
AP_LIMITS = tuple(round(IOU_LIMIT + 0.05 * i, 2) for i in range(10))
"""COCO's, from the one that pairs are made by."""
DISTANCES = other.DISTANCES
OUTLINE_LIMITS = (0.5, 0.9)
OUTLINES = ("under 50%", "50-90%", "over 90%")
COMPARED = ("ap50", "ap", "precision", "recall", "f1", "located")
COMPARED_MEMORY = ("memory_precision", "memory_recall")
"""Metrics in which perceptions are compared with each other."""


@dataclass(frozen=True, slots=True)
class LabelConfusion:
    """Objects of a category that were detected with another label."""

    category: str
    label: str
    num: int
    share: Estimate
    """Share of the category's objects."""


@dataclass(frozen=True, slots=True)
class Scores:
    """Scores of one perception."""

    perception: str
    num_tasks: int
    num_houses: int
    num_views: int
    overall: Measures
    groups: Mapping[str, Mapping[str, Measures]]
    """Objects and detections by `category`, `distance`, `size` and `outline`."""
    confusions: Sequence[LabelConfusion]
    """The most frequent first."""
    unexplained: Sequence[tuple[str, int]]
    """Labels of detections where no object is, the most frequent first."""
    precision_curve: Sequence[float]
    """Mean over categories of the interpolated precision at recalls 0, 0.01, .. 1."""
    calibration: Sequence[tuple[float, Estimate]]
    """Mean confidence and precision of detections, by tenths of confidence; empty ones are left out."""
    depth: Mapping[str, Measures]
    cosines: Mapping[str, Sequence[int]]
    """Counts in bins of -1..1; none without features."""
    memory: Measures
    memory_curve: Sequence[tuple[float, Measures]]
    """Metrics by share of the first house's tour."""
    pictures: Sequence[tuple[str, str]] = field(default=(), repr=False)
    """Task and JPEG in base64."""


def scores(records: Mapping[str, Sequence[TaskRecord]]) -> list[Scores]:
    """Score every perception from its records, which are of the same tasks for all.

    Raises:
        StoreError: There is no record.
    """
    if not records or not all(records.values()):
        raise StoreError("no task has a record of every perception yet: run the command again")
    return [_Scorer(perception, mine).scores() for perception, mine in records.items()]


def differences(found: Sequence[Scores]) -> dict[tuple[str, str], Measures]:
    """Return one perception less another, for every two, in the metrics that detectors are usually compared by."""
    return {
        (b.perception, a.perception): {
            name: theirs[name].minus(ours[name])
            for ours, theirs, names in ((a.overall, b.overall, COMPARED), (a.memory, b.memory, COMPARED_MEMORY))
            for name in names
            if name in ours and name in theirs
        }
        for a, b in combinations(found, 2)
    }


class _Scorer:
    """One perception's objects and detections as arrays."""

    def __init__(self, perception: str, records: Sequence[TaskRecord]) -> None:
        self.perception, self.records = perception, records
        self.houses = ClusterBootstrap([r.house for r in records], num_resamples=NUM_RESAMPLES)
        truths, found = [r.truths for r in records], [r.detections for r in records]
        self.truth_house = np.repeat(self.houses.cluster_of, [len(t.view) for t in truths])
        self.house = np.repeat(self.houses.cluster_of, [len(d.view) for d in found])
        self.truth_category = np.array([c for t in truths for c in t.category], dtype=object)
        self.is_found = np.array([i >= 0 for t in truths for i in t.found], np.bool_)
        self.is_located = np.array([i >= 0 for t in truths for i in t.located], np.bool_)
        self.label = np.array([label for d in found for label in d.label], dtype=object)
        self.confidence = np.array([c for d in found for c in d.confidence], np.float64)
        self.partner = np.array([i for d in found for i in d.found], np.int64)
        self.iou = np.array([i for d in found for i in d.found_iou], np.float64)
        self.place = np.array([i for d in found for i in d.located], np.int64)
        self.place_iou = np.array([i for d in found for i in d.located_iou], np.float64)
        # What the object at a detection's place is; "" where there is none.
        self.place_category = np.array(
            [t.category[i] if i >= 0 else "" for t, d in zip(truths, found, strict=True) for i in d.located],
            dtype=object,
        )
        self.truth_group = {
            "distance": _distance_bins([v for t in truths for v in t.distance_m]),
            "size": _size_bins([v / r.image_px for r in records for v in r.truths.area_px]),
            "outline": np.digitize(np.array([v for t in truths for v in t.outline_share], np.float64), OUTLINE_LIMITS),
        }
        self.group = {
            "distance": _distance_bins([math.inf if v is None else v for d in found for v in d.distance_m]),
            "size": _size_bins([v / r.image_px for r in records for v in r.detections.area_px]),
        }

    def scores(self) -> Scores:
        records, houses = self.records, self.houses
        curve, precisions = self._average_precisions()
        everything = np.ones(len(self.truth_house), np.bool_), np.ones(len(self.house), np.bool_)
        overall = {**self._measures(*everything), **precisions.pop("")}
        groups = {"category": self._categories(precisions)}
        for by, names in (("distance", DISTANCES), ("size", SIZES), ("outline", OUTLINES)):
            found = self.group.get(by)
            groups[by] = {
                name: self._measures(self.truth_group[by] == i, None if found is None else found == i)
                for i, name in enumerate(names)
            }
        counted = self.partner != IGNORED
        ranked = (self.confidence[counted], self.partner[counted] >= 0, self.house[counted])
        error, calibration = other.calibration(houses, *ranked)
        depth = other.depth_groups(houses, records)
        cosines, texts = other.cosines(houses, records)
        return Scores(
            perception=self.perception,
            num_tasks=len(records),
            num_houses=houses.num_clusters,
            num_views=sum(sum(record.num_views) for record in records),
            overall={**overall, **error, **depth.pop("all"), **other.pose(houses, records), **texts},
            groups=groups,
            confusions=self._confusions(),
            unexplained=Counter(self.label[self.place == NONE].tolist()).most_common(),
            precision_curve=curve,
            calibration=calibration,
            depth=depth,
            cosines=cosines,
            memory=other.memory(houses, records),
            memory_curve=other.memory_curve(houses, records),
            pictures=[(record.task_id, record.picture) for record in records if record.picture is not None],
        )

    def _measures(self, truths: NDArray[np.bool_], found: NDArray[np.bool_] | None) -> dict[str, Estimate]:
        """Compute rates among some objects and some detections.

        Args:
            truths: `(T,)` which objects.
            found: `(D,)` which detections; `None` where detections have no such property, and thus no precision.
        """
        houses, of = self.houses, self.truth_house[truths]
        is_found, is_located = self.is_found[truths], self.is_located[truths]
        right, wanted = houses.sums(is_found, of), houses.sums(np.ones(len(of)), of)
        measures = {
            "recall": houses.rate(is_found, np.ones(len(of)), of),
            "located": houses.rate(is_located, np.ones(len(of)), of),
            "labelled": houses.rate(is_found & is_located, is_located, of),
        }
        if found is None:
            return measures
        counted, placed = found & (self.partner != IGNORED), found & (self.place >= 0)
        is_hit = counted & (self.partner >= 0)
        measures["precision"] = houses.rate(is_hit, counted, self.house)
        # Objects of a kind and detections of a kind need not be partners (a distance may be wrong): each counts half.
        hits, claims = houses.sums(is_hit, self.house), houses.sums(counted, self.house)
        measures["f1"] = houses.ratio(right + hits, wanted + claims, len(of))
        measures["iou"] = houses.rate(np.where(placed, self.place_iou, 0.0), placed, self.house)
        return measures

    def _categories(self, precisions: Mapping[str, Measures]) -> dict[str, Measures]:
        counts = Counter(self.truth_category.tolist())
        return {
            name: {**self._measures(self.truth_category == name, self.label == name), **precisions[name]}
            for name in sorted(counts, key=lambda name: (-counts[name], name))
        }

    def _average_precisions(self) -> tuple[list[float], dict[str, dict[str, Estimate]]]:
        """Return the mean curve, and AP by category; "" has their mean, and AP of places alone."""
        houses, draws = self.houses, self.houses.draws[:NUM_AP_RESAMPLES]
        names = sorted(set(self.truth_category.tolist()))
        if not names:
            return [], {"": {}}
        values = np.zeros((len(names), len(AP_LIMITS)))
        drawn = np.zeros((len(names), len(AP_LIMITS), len(draws)))
        curves, found = [], {}
        for i, name in enumerate(names):
            mine = self.label == name
            wanted = houses.sums(self.truth_category == name, self.truth_house)
            for j, limit in enumerate(AP_LIMITS):
                curve, drawn[i, j] = self._precision_curve(mine, self.partner, self.iou, wanted, limit, draws)
                values[i, j] = curve.mean()
                if j == 0:
                    curves.append(curve)
            found[name] = {"ap50": houses.estimate(float(values[i, 0]), drawn[i, 0], int(wanted.sum()))}
        num, every = len(self.truth_house), np.ones(len(self.house), np.bool_)
        wanted = houses.sums(np.ones(num), self.truth_house)
        curve, of_places = self._precision_curve(every, self.place, self.place_iou, wanted, AP_LIMITS[0], draws)
        # A resample may lack a category; then the mean is over the others.
        averages = np.nanmean(drawn, axis=0)
        found[""] = {
            "ap50": houses.estimate(float(values[:, 0].mean()), averages[0], num),
            "ap": houses.estimate(float(values.mean()), averages.mean(axis=0), num),
            "ap50_located": houses.estimate(float(curve.mean()), of_places, num),
        }
        return np.mean(curves, axis=0).tolist(), found

    def _precision_curve(
        self,
        mine: NDArray[np.bool_],
        partner: NDArray[np.int64],
        iou: NDArray[np.float64],
        wanted: NDArray[np.float64],
        limit: float,
        draws: NDArray[np.float64],
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the curve at an IoU limit, and AP in resamples. Pairs at a higher limit are some of those at 0.5."""
        is_pair = iou >= limit - 1e-6  # rounded in records
        counted = mine & ~((partner == IGNORED) & is_pair)
        ranked = (self.confidence[counted], ((partner >= 0) & is_pair)[counted])
        return interpolated(*ranked, int(wanted.sum())), resampled(*ranked, self.house[counted], wanted, draws)

    def _confusions(self) -> list[LabelConfusion]:
        """Count objects at whose place there is a detection with another label."""
        wrong = (self.place >= 0) & (self.place_category != self.label)
        pairs = Counter(zip(self.place_category[wrong].tolist(), self.label[wrong].tolist(), strict=True))
        found = []
        for (category, label), num in sorted(pairs.items(), key=lambda pair: (-pair[1], pair[0])):
            mine = wrong & (self.place_category == category) & (self.label == label)
            there = self.truth_category == category
            tops, bottoms = self.houses.sums(mine, self.house), self.houses.sums(there, self.truth_house)
            share = self.houses.ratio(tops, bottoms, int(there.sum()))
            found.append(LabelConfusion(category, label, num, share))
        return found


def _distance_bins(distances_m: Sequence[float]) -> NDArray[np.int64]:
    return np.digitize(np.array(distances_m, np.float64), DISTANCE_BINS_M[1:])


def _size_bins(shares: Sequence[float]) -> NDArray[np.int64]:
    return np.digitize(np.array(shares, np.float64), SIZE_LIMITS)
