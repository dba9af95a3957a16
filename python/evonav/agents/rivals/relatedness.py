"""Say how much what a view shows has to do with a goal: it stands for the image-text model of the originals."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from evonav.decision.home_statistics import room_ratios
from evonav.decision.text.language import ParsedGoal
from evonav.decision.text.matcher import Matcher
from evonav.sensors.observation import Detections

Feature = NDArray[np.float32]

ROOM_WORTH = 0.3
"""Relatedness of a sign of the type of room in which the goal is most frequent; that of what is near a goal is 0.4."""


class Relatedness:
    """Compares labels, or image features where the perception has some, with one goal."""

    def __init__(self, matcher: Matcher, goal: ParsedGoal, feature: Feature | None) -> None:
        """Compare labels with the goal, or, with the `(D,)` unit feature of its text, features."""
        self._matcher = matcher
        self._goal = goal
        self._feature = feature
        self._by_label: dict[str, float] = {}

    def of(self, label: str, feature: Feature | None = None) -> float:
        """Return how much a thing has to do with the goal, 0 to 1.

        Args:
            feature: Its `(D,)` unit image feature, if there is one.

        Returns:
            The cosine of the features, 0 if it is negative. Without features: 1 for the goal's own label, 0.5 and 0.4
            for what the goal should be on and near, and at most `ROOM_WORTH` for signs of a type of room: of the one
            that the goal names, else of each type by how frequent the goal is there.
        """
        if self._feature is not None and feature is not None:
            return max(0.0, float(self._feature @ feature))
        if label not in self._by_label:
            self._by_label[label] = self._matcher.label_score(self._goal, label) or self._of_room(label)
        return self._by_label[label]

    def of_view(self, detections: Detections) -> float:
        """Return the largest relatedness of a view's detections; 0 without any."""
        features: Sequence[Feature | None] = [None] * len(detections.labels)
        if detections.features is not None:
            features = list(detections.features)
        pairs = zip(detections.labels, features, strict=True)
        return max((self.of(label, feature) for label, feature in pairs), default=0.0)

    def _of_room(self, label: str) -> float:
        room = self._matcher.sign_of(label)
        if room is None:
            return 0.0
        if self._goal.room is not None:
            return ROOM_WORTH if room == self._goal.room else 0.0
        ratios = room_ratios(self._goal.noun)
        return ROOM_WORTH * ratios[room] / max(ratios.values()) if ratios else 0.0
