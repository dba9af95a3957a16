"""Measures the mini detector on houses that it was not trained on.

    python scripts/mini_detector/measure_mini.py --tasks VAL_TASKS [MORE] --per-house 4

Prints, with 95% intervals from a bootstrap over houses: recall and precision of instances (of the same type and at
least half in common, IoU >= 0.5), recall by pixels, AP50 (all types pooled by confidence, and the mean over types that
occur ten times or more), mean IoU of types, and the time a view.
"""

import argparse
import time
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from mini_frames import LabelledFrame, frames, house_files

from evonav.perception.detector import DetectorView, Found
from evonav.perception.mini import MiniConfig, MiniDetector
from evonav.statistics import ClusterBootstrap

MIN_AREA_PX = 90
"""Smaller objects are no detections under ground truth either (0.1% of the image): finding one is not held against."""
SIZES_PX = {"90 to 300 px": (90, 300), "300 to 1,000 px": (300, 1000), "1,000 px or more": (1000, 10**9)}


@dataclass
class House:
    """What was counted in one house."""

    hits: list[tuple[str, int, bool]] = field(default_factory=list)
    """Type, pixels and whether it was found, of each object."""
    claims: list[tuple[str, float, bool]] = field(default_factory=list)
    """Type, confidence and whether it is right, of each detection."""
    areas: dict[str, list[int]] = field(default_factory=lambda: defaultdict(lambda: [0, 0]))
    """Pixels in common and in either, by type."""


def main() -> None:
    """Measures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tasks", nargs="+", type=Path, required=True)
    parser.add_argument("--per-house", type=int, default=4)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--weights", type=Path)
    parser.add_argument("--min-confidence", type=float, default=0.25)
    parser.add_argument("--min-cells", type=int, default=2)
    args = parser.parse_args()
    detector = MiniDetector(MiniConfig(min_confidence=args.min_confidence, min_cells=args.min_cells), args.weights)
    houses: dict[str, House] = defaultdict(House)
    num_views, spent_s = 0, 0.0
    for frame in frames([t for folder in args.tasks for t in house_files(folder)], args.per_house, args.seed):
        began_s = time.process_time()
        (found,) = detector.detect([DetectorView(frame.rgb, frame.depth_m, frame.horizon_rad)])
        spent_s += time.process_time() - began_s
        num_views += 1
        count(houses[frame.house], frame, found)
    counted = list(houses.values())
    print(f"{num_views} views in {len(counted)} houses, {1e3 * spent_s / num_views:.1f} ms of processor time a view")
    tell("recall", counted, recall)
    for name, (low, high) in SIZES_PX.items():
        tell(f"recall, {name}", counted, lambda some, low=low, high=high: recall(some, low, high))
    tell("precision", counted, precision)
    tell("AP50, all types pooled", counted, pooled_ap)
    tell("AP50, mean over types", counted, mean_ap)
    tell("mean IoU of types", counted, mean_iou)


def count(house: House, frame: LabelledFrame, found: Found) -> None:
    """Matches detections, the surest first, to objects of their type."""
    areas = np.bincount(frame.instances.ravel(), minlength=len(frame.labels) + 1)
    taken: set[int] = set()
    for index in np.argsort(-found.confidences, kind="stable").tolist():
        mask, label = found.masks[index], found.labels[index]
        inside = np.bincount(frame.instances[mask], minlength=len(frame.labels) + 1)
        either = areas + mask.sum() - inside
        right = [
            i
            for i, name in enumerate(frame.labels, 1)
            if name == label and i not in taken and 2 * inside[i] >= either[i]
        ]
        if right:
            taken.add(right[0])
        # What is too small to count is left out, found or not.
        if (areas[right[0]] if right else mask.sum()) >= MIN_AREA_PX:
            house.claims.append((label, float(found.confidences[index]), bool(right)))
    for number, label in enumerate(frame.labels, 1):
        if areas[number] >= MIN_AREA_PX:
            house.hits.append((label, int(areas[number]), number in taken))
    for label in {*frame.labels, *found.labels}:
        is_there = np.isin(frame.instances, [i for i, name in enumerate(frame.labels, 1) if name == label])
        is_said = found.masks[[name == label for name in found.labels]].any(0)
        house.areas[label][0] += int((is_there & is_said).sum())
        house.areas[label][1] += int((is_there | is_said).sum())


def tell(name: str, houses: list[House], measure: Callable[[list[House]], tuple[float, int]]) -> None:
    """Prints a figure, its interval and what it is over."""
    value, num = measure(houses)
    bootstrap = ClusterBootstrap([str(i) for i in range(len(houses))], num_resamples=200)
    counts = bootstrap.draws[:, bootstrap.cluster_of].astype(int)
    draws = [np.repeat(np.arange(len(houses)), row) for row in counts]
    found = bootstrap.estimate(value, np.array([measure([houses[i] for i in drawn])[0] for drawn in draws]), num)
    ends = "" if found.ci95 is None else " [{:.3f}, {:.3f}]".format(*found.ci95)
    print(f"{name}: {value:.3f}{ends}, n = {num}")


def recall(houses: list[House], low: int = 0, high: int = 10**9) -> tuple[float, int]:
    """Objects of some size that were found."""
    hits = [is_found for house in houses for _, area, is_found in house.hits if low <= area < high]
    return (float(np.mean(hits)) if hits else float("nan")), len(hits)


def precision(houses: list[House]) -> tuple[float, int]:
    """Detections that are right."""
    right = [is_right for house in houses for _, _, is_right in house.claims]
    return (float(np.mean(right)) if right else float("nan")), len(right)


def average_precision(claims: list[tuple[float, bool]], num_objects: int) -> float:
    """Area under the curve of precision, made monotone, over recall."""
    claims = sorted(claims, key=lambda claim: -claim[0])
    right = np.cumsum([is_right for _, is_right in claims])
    if not len(right):
        return 0.0
    precisions = np.maximum.accumulate((right / np.arange(1, len(right) + 1))[::-1])[::-1]
    return float((precisions * np.diff(right, prepend=0)).sum() / num_objects)


def pooled_ap(houses: list[House]) -> tuple[float, int]:
    """All types together."""
    claims = [(confidence, right) for house in houses for _, confidence, right in house.claims]
    num = sum(len(house.hits) for house in houses)
    return average_precision(claims, max(num, 1)), num


def mean_ap(houses: list[House]) -> tuple[float, int]:
    """Over types that occur ten times or more."""
    claims, nums = defaultdict(list), defaultdict(int)
    for house in houses:
        for label, confidence, right in house.claims:
            claims[label].append((confidence, right))
        for label, _, _ in house.hits:
            nums[label] += 1
    values = [average_precision(claims[label], num) for label, num in nums.items() if num >= 10]
    return float(np.mean(values)), len(values)


def mean_iou(houses: list[House]) -> tuple[float, int]:
    """Over types that occur."""
    common, either = defaultdict(int), defaultdict(int)
    for house in houses:
        for label, (both, any_of) in house.areas.items():
            common[label] += both
            either[label] += any_of
    occurring = {label for house in houses for label, _, _ in house.hits}
    return float(np.mean([common[label] / either[label] for label in occurring])), len(occurring)


if __name__ == "__main__":
    main()
