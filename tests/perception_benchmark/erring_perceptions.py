"""Ground truth with errors that are known: what reports of perceptions must tell."""

import math
from dataclasses import replace

import numpy as np

from evonav.perception.ground_truth import GroundTruthPerception
from evonav.sensors.observation import Detections

FEATURES = np.eye(8, dtype=np.float32)


class Erring:
    """Drops detections at random, tells some categories as others, errs about depth and pose, and has features."""

    def __init__(self, miss_rate=0.0, seed=0, told_as=None, depth_factor=1.0, offset_m=0.0, has_features=False):
        self.needs_rgb = False
        self._truth = GroundTruthPerception()
        self._random = np.random.Generator(np.random.PCG64(seed))
        self._miss_rate, self._told_as = miss_rate, told_as or {}
        self._depth_factor, self._offset_m, self._has_features = depth_factor, offset_m, has_features

    def begin_stage(self, scene):
        self._truth.begin_stage(scene)

    def text_feature(self, text):
        return self._feature(text.replace(" ", "")) if self._has_features else None

    def perceive(self, frames):
        return [self._erring(percept) for percept in self._truth.perceive(frames)]

    def _erring(self, percept):
        found = percept.detections
        kept = np.flatnonzero(self._random.random(len(found.labels)) >= self._miss_rate)
        numbers = np.full(len(found.labels) + 1, -1, np.int32)
        numbers[kept] = np.arange(len(kept))
        labels = tuple(self._told_as.get(found.labels[i], found.labels[i]) for i in kept)
        features = np.stack([self._feature(label) for label in labels]) if self._has_features and labels else None
        detections = Detections(numbers[found.masks], labels, found.confidences[kept] * np.float32(0.75), features)
        pose = replace(percept.pose, x_m=percept.pose.x_m + self._offset_m, yaw_rad=percept.pose.yaw_rad + 2 * math.pi)
        return replace(
            percept, detections=detections, depth_m=percept.depth_m * np.float32(self._depth_factor), pose=pose
        )

    def _feature(self, word):
        return FEATURES[sum(map(ord, word.lower())) % len(FEATURES)]


def missing_a_third():
    return Erring(miss_rate=1 / 3, seed=1)


def confusing():
    return Erring(told_as={"DiningTable": "Desk"})


def deep():
    return Erring(depth_factor=1.1, offset_m=0.25, has_features=True)


def breaking():
    return Broken()


class Broken(Erring):
    """Fails at its first view."""

    def perceive(self, frames):
        raise RuntimeError("out of memory")


class Weighted(Erring):
    """Needs weights, of which there are two versions."""

    version = "one"

    def check(self, agents):
        assert list(agents) == ["fu"]
        return {"weights": self.version}


def weighted():
    return Weighted()
