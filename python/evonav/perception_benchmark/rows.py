"""Collect rows and sums of one perception on one task, view by view."""

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from evonav.errors import InvalidArgumentError
from evonav.perception import Percept
from evonav.perception_benchmark.matching import (
    IGNORED,
    NONE,
    Matches,
    TrueObjects,
    intersections_over_union,
    main_objects,
    match,
    median_depths_m,
    same_labels,
)
from evonav.perception_benchmark.records import (
    DISTANCE_BINS_M,
    NUM_COSINE_BINS,
    DepthSums,
    DetectionRows,
    FeatureSums,
    PoseRows,
    TrueRows,
)
from evonav.tasks.language import STRUCTURE_TYPES
from evonav.world.simulator import Frame, SceneObject

MAX_FEATURES = 400
"""Largest number of a task's features that are compared, spread evenly over its detections."""


@dataclass(frozen=True, slots=True)
class Matched:
    """A view's matchings: by label, and by place alone."""

    found: Matches
    located: Matches


def scored_percept(frame: Frame, percept: Percept) -> Percept:
    """Return a percept without the doors and windows that it reports, which are not scored.

    Raises:
        InvalidArgumentError: See `check_percept`.
    """
    check_percept(frame, percept)
    found = percept.detections
    scored = [index for index, label in enumerate(found.labels) if label not in STRUCTURE_TYPES]
    return replace(percept, detections=found.taken(scored))


def check_percept(frame: Frame, percept: Percept) -> None:
    """Reject a percept with malformed arrays, before it is counted.

    Raises:
        InvalidArgumentError: The message names the array and what is wrong with it.
    """
    found, shape = percept.detections, frame.depth_m.shape
    num = len(found.labels)
    for name, array in (("masks", found.masks), ("depth_m", percept.depth_m)):
        if array.shape != shape:
            raise InvalidArgumentError(f"a percept's `{name}` has shape {array.shape}, expected the frame's, {shape}")
    if found.masks.dtype.kind != "i" or found.masks.min(initial=-1) < -1 or found.masks.max(initial=-1) >= num:
        raise InvalidArgumentError(f"a percept's `masks` have other values than whole numbers of -1 to {num - 1}")
    confidences = found.confidences
    if confidences.shape != (num,) or not ((confidences >= 0.0) & (confidences <= 1.0)).all():
        raise InvalidArgumentError(f"a percept's `confidences` are not {num} numbers of 0 to 1")
    if found.features is not None and (found.features.ndim != 2 or len(found.features) != num):
        raise InvalidArgumentError(f"a percept's `features` have shape {found.features.shape}, expected ({num}, D)")


@dataclass(slots=True)
class Rows:
    """Rows of one perception on one task."""

    truths: TrueRows = field(default_factory=TrueRows)
    detections: DetectionRows = field(default_factory=DetectionRows)
    depth: DepthSums = field(default_factory=DepthSums)
    pose: PoseRows = field(default_factory=PoseRows)
    _features: list[NDArray[np.float32]] = field(default_factory=list)
    _of: list[tuple[int, str, str]] = field(default_factory=list)
    """View, id and category of the object that each feature is of."""
    _num_views: int = 0

    def add(
        self, stage: int, frame: Frame, percept: Percept, truth: TrueObjects, objects: Sequence[SceneObject]
    ) -> Matched:
        """Add a scored percept of a view of a stage's house; `objects` are the simulator's bodies, in order."""
        found = percept.detections
        ious = intersections_over_union(truth, found)
        matched = Matched(
            match(ious, found.confidences, truth.num_wanted, is_allowed=same_labels(truth, found)),
            match(ious, found.confidences, truth.num_wanted),
        )
        self._add_rows(stage, percept, truth, matched)
        self._add_depth(frame, percept)
        self.pose.offset_m.append(
            round(math.hypot(percept.pose.x_m - frame.pose.x_m, percept.pose.z_m - frame.pose.z_m), 5)
        )
        turn_rad = percept.pose.yaw_rad - frame.pose.yaw_rad
        self.pose.turn_rad.append(round(abs(math.remainder(turn_rad, 2 * math.pi)), 6))
        if found.features is not None:
            for d, index in enumerate(main_objects(truth, found).tolist()):
                if index != NONE and objects[index].kind == "object":
                    self._features.append(found.features[d])
                    self._of.append((self._num_views, objects[index].id, objects[index].category))
        self._num_views += 1
        return matched

    def features(self, text_feature: Callable[[str], NDArray[np.float32] | None]) -> FeatureSums:
        """Compare features of the same and of different objects, and features of objects and their names."""
        if not self._features:
            return FeatureSums()
        chosen = np.unique(np.linspace(0, len(self._features) - 1, MAX_FEATURES).astype(np.int64)).tolist()
        matrix = np.stack([self._features[i] for i in chosen]).astype(np.float64)
        of = [self._of[i] for i in chosen]
        views, names, categories = (np.array(column, dtype=object) for column in zip(*of, strict=True))
        cosines = matrix @ matrix.T
        is_pair = np.triu(np.ones(cosines.shape, np.bool_), 1)
        is_same = (names[:, None] == names[None, :]).astype(np.bool_)
        is_alike = (categories[:, None] == categories[None, :]).astype(np.bool_)
        is_other_view = (views[:, None] != views[None, :]).astype(np.bool_)
        compared = {
            "same_object": cosines[is_pair & is_same & is_other_view],
            "same_category": cosines[is_pair & ~is_same & is_alike],
            "other": cosines[is_pair & ~is_alike],
        }
        spelled = sorted(set(categories.tolist()))
        # `DiningTable` as `dining table`
        texts = [text_feature(re.sub(r"(?<=[a-z])(?=[A-Z])", " ", word).lower()) for word in spelled]
        known = [text for text in texts if text is not None]
        right = 0, 0
        if len(known) == len(spelled) and all(text.shape == matrix.shape[1:] for text in known):
            similarity = matrix @ np.stack(known).astype(np.float64).T
            own = np.array([spelled.index(word) for word in categories.tolist()])
            is_own = own[:, None] == np.arange(len(spelled))[None, :]
            compared |= {"text_own": similarity[is_own], "text_other": similarity[~is_own]}
            right = int((similarity.argmax(axis=1) == own).sum()), len(own)
        counts = {name: _counts(values) for name, values in compared.items()}
        totals = {name: round(float(values.sum()), 6) for name, values in compared.items()}
        return FeatureSums.model_validate({**counts, "totals": totals, "num_right": right[0], "num_texts": right[1]})

    def _add_rows(self, stage: int, percept: Percept, truth: TrueObjects, matched: Matched) -> None:
        found, truths, rows = percept.detections, self.truths, self.detections
        num, wanted = len(found.labels), truth.num_wanted
        first_truth, first_row = len(truths.view), len(rows.view)
        truths.stage += [stage] * wanted
        truths.view += [self._num_views] * wanted
        truths.category += truth.labels[:wanted]
        truths.area_px += truth.areas_px[:wanted].tolist()
        truths.distance_m += [round(value, 3) for value in truth.distances_m[:wanted].tolist()]
        truths.outline_share += [round(value, 3) for value in truth.outline_shares[:wanted].tolist()]
        truths.found += _shifted(matched.found.detection_of[:wanted], first_row)
        truths.located += _shifted(matched.located.detection_of[:wanted], first_row)
        areas = np.bincount(found.masks[found.masks >= 0], minlength=num)
        distances_m = median_depths_m(percept.depth_m, found.masks, num).tolist()
        rows.stage += [stage] * num
        rows.view += [self._num_views] * num
        rows.label += found.labels
        rows.confidence += [round(value, 6) for value in found.confidences.tolist()]
        rows.area_px += areas.tolist()
        rows.distance_m += [round(value, 3) if math.isfinite(value) else None for value in distances_m]
        for pairs, partners, ious in (
            (matched.found, rows.found, rows.found_iou),
            (matched.located, rows.located, rows.located_iou),
        ):
            partners += _shifted(pairs.object_of, first_truth)
            ious += [round(value, 6) for value in pairs.ious.tolist()]

    def _add_depth(self, frame: Frame, percept: Percept) -> None:
        is_true = np.isfinite(frame.depth_m)
        true_m = frame.depth_m[is_true].astype(np.float64)
        bins = np.digitize(true_m, DISTANCE_BINS_M[1:])
        num_bins, sums = len(DISTANCE_BINS_M), self.depth
        sums.num = _added(sums.num, np.bincount(bins, minlength=num_bins))
        if percept.depth_m is frame.depth_m:
            return
        perceived_m = percept.depth_m[is_true].astype(np.float64)
        is_perceived = np.isfinite(perceived_m)
        sums.num_lost = _added(sums.num_lost, np.bincount(bins[~is_perceived], minlength=num_bins))
        bins, true_m = bins[is_perceived], true_m[is_perceived]
        errors_m = perceived_m[is_perceived] - true_m
        weights = np.abs(errors_m) / true_m
        for name, values in (("relative", weights), ("square_m2", np.square(errors_m))):
            totals = np.bincount(bins, values, minlength=num_bins).tolist()
            setattr(sums, name, [a + b for a, b in zip(getattr(sums, name), totals, strict=True)])


def _shifted(partners: NDArray[np.int64], first: int) -> list[int]:
    """Return partners in a view as rows of all views."""
    return [value if value in (NONE, IGNORED) else value + first for value in partners.tolist()]


def _added(counts: list[int], more: NDArray[np.int64]) -> list[int]:
    return [a + b for a, b in zip(counts, more.tolist(), strict=True)]


def _counts(cosines: NDArray[np.float64]) -> list[int]:
    bins = np.floor((np.clip(cosines, -1.0, 1.0) + 1.0) / 2.0 * NUM_COSINE_BINS).astype(np.int64)
    counts: list[int] = np.bincount(np.minimum(bins, NUM_COSINE_BINS - 1), minlength=NUM_COSINE_BINS).tolist()
    return counts
