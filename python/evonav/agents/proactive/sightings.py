"""Detections that became no entry, because they are far away or small: leads to what was not seen from near."""

import math
from dataclasses import dataclass

import numpy as np

from evonav.agents.grid import box_distance_m
from evonav.decision.candidates import ObjectCandidate
from evonav.decision.text.language import canonical, is_structure
from evonav.memory.objects import ObjectMap, ObjectUpdate
from evonav.points import Point2, Point3
from evonav.sensors.observation import View
from evonav.world.camera import project, unproject_pixels

MIN_PX, STRIDE = 4, 2
"""Smallest number of pixels with a depth, of every second pixel of every second row."""
ABSENT_M, BAND_M = 3.0, 0.3
"""A sighting is dropped if a view from within this distance sees through its place, by more than this."""
SAME_M, SAME_SHARE = 0.75, 0.1
"""Two sightings of a label are one if they are within this distance, or within this share of the farther one's range:
the middle of what is seen shifts with the direction."""


@dataclass(slots=True)
class FarSighting:
    """Something that was detected and is not remembered as an entry."""

    label: str
    centre_m: Point3
    """Median of what was seen, `(x, y, z)`."""
    range_m: float
    """Distance from which it was seen, at least."""
    stage: int
    round: int
    """Number of the round in which it was last seen."""

    @property
    def ground_m(self) -> Point2:
        """Its place on the floor, `(x, z)`."""
        return (self.centre_m[0], self.centre_m[2])


class Sightings:
    """All such detections, by label."""

    def __init__(self) -> None:
        self.all: list[FarSighting] = []
        self.stage = self.round = 0

    def begin_stage(self, stage: int) -> None:
        """Keep what was seen in earlier stages."""
        self.stage, self.round = stage, 0

    def see(self, objects: ObjectMap, view: View, update: ObjectUpdate) -> None:
        """Take in the detections of a view; what an entry covers is no sighting."""
        labels = view.detections.labels
        missing = [
            index
            for index, entry_id in enumerate(update.entry_ids)
            if entry_id is None and not is_structure(labels[index])
        ]
        if missing:
            self._add_all(missing, view)
        names = {canonical(one.label) for one in self.all}
        boxes = [
            ObjectCandidate(one.id, canonical(one.label), one.centre_m, one.size_m, one.num_detections)
            for one in (objects.entries if names else ())
            if canonical(one.label) in names
        ]
        self.all = [one for one in self.all if not _is_covered(one, boxes)]
        self._drop_absent(view)

    def _add_all(self, missing: list[int], view: View) -> None:
        labels, masks = view.detections.labels, view.detections.masks
        is_missing = np.zeros(len(labels) + 1, np.bool_)  # index -1 finds the last
        is_missing[missing] = True
        rows, cols = np.nonzero(is_missing[masks[::STRIDE, ::STRIDE]])
        rows, cols = rows * STRIDE, cols * STRIDE
        is_known = np.isfinite(view.depth_m[rows, cols])
        rows, cols = rows[is_known], cols[is_known]
        owners = masks[rows, cols]
        points_m = unproject_pixels(rows, cols, view.depth_m, view.pose, view.intrinsics)
        for index in missing:
            mine = points_m[owners == index]
            if len(mine) >= MIN_PX:
                x_m, y_m, z_m = np.median(mine, axis=0).tolist()
                self._add(labels[index], (x_m, y_m, z_m), view)

    def _drop_absent(self, view: View) -> None:
        """Drop what a view should show and does not detect."""
        old = [one for one in self.all if not self.is_current(one)]
        if not old:
            return
        seen = project(np.array([one.centre_m for one in old]), view.pose, view.intrinsics)
        height_px, width_px = view.depth_m.shape
        for one, (col, row, depth_m) in zip(old, seen.tolist(), strict=True):
            if not (depth_m <= ABSENT_M and 0.0 <= col < width_px and 0.0 <= row < height_px):  # also if it is NaN
                continue
            if view.depth_m[int(row), int(col)] >= depth_m + BAND_M:
                self.drop(one)

    def _add(self, label: str, centre_m: Point3, view: View) -> None:
        range_m = math.dist((centre_m[0], centre_m[2]), (view.pose.x_m, view.pose.z_m))
        name = canonical(label)
        known = [one for one in self.all if canonical(one.label) == name]
        nearest = min(known, key=lambda one: math.dist(one.centre_m, centre_m), default=None)
        if nearest is None or math.dist(nearest.centre_m, centre_m) > max(SAME_M, SAME_SHARE * range_m):
            self.all.append(FarSighting(label, centre_m, range_m, self.stage, self.round))
            return
        nearest.stage, nearest.round = self.stage, self.round
        if range_m < nearest.range_m:
            nearest.centre_m, nearest.range_m = centre_m, range_m

    def is_current(self, one: FarSighting) -> bool:
        """Return whether something was seen in the present round."""
        return one.stage == self.stage and one.round == self.round

    def drop(self, one: FarSighting) -> None:
        """Forget something that is not there, or not the goal."""
        self.all = [other for other in self.all if other is not one]


def _is_covered(one: FarSighting, boxes: list[ObjectCandidate]) -> bool:
    """Return whether something is an entry by now."""
    reach_m = max(SAME_M, SAME_SHARE * one.range_m)
    return any(box.label == canonical(one.label) and box_distance_m(box, one.ground_m) <= reach_m for box in boxes)
