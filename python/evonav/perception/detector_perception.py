"""Perceive with a detector: filter what it finds, keep one label for each pixel, and name ProcTHOR's types.

Only colours and depth go in; instances and the scene's objects are not used.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evonav.errors import InvalidArgumentError
from evonav.perception.detector import Detector, DetectorView, Embedder, Found
from evonav.perception.filters import FilterConfig, filtered, mask_areas_px, one_label_a_pixel
from evonav.perception.perception import Percept, Perception
from evonav.perception.vocabulary import TYPE_OF_WORD
from evonav.sensors.observation import Detections
from evonav.world.simulator import Frame


class DetectorPerception(Perception):
    """Perception that returns a detector's detections as percepts; depth and pose are the frame's own."""

    needs_rgb = True

    def __init__(
        self,
        detector: Detector,
        filters: FilterConfig | None = None,
        embedder: Embedder | None = None,
        *,
        facts_of: Callable[[Sequence[str]], dict[str, Any]] = lambda agents: {},
    ) -> None:
        """Make a perception over models that may be shared.

        Args:
            filters: Filters on detections; default: 3D-Mem's values.
            embedder: Computes the features of the remaining detections; default: the detector's own, if it has any.
            facts_of: See `check`.
        """
        self._detector = detector
        self._filters = filters or FilterConfig()
        self._embedder = embedder
        self._facts_of = facts_of

    def check(self, agents: Sequence[str]) -> dict[str, Any]:
        """Return what decides results besides options, such as checksums of weights.

        Args:
            agents: Agents that will use it.

        Raises:
            PerceptionError: Something that it needs is missing; the message says what to do.
        """
        return self._facts_of(agents)

    def perceive(self, frames: Sequence[Frame]) -> list[Percept]:
        """Perceive the views of a round, as one batch.

        Raises:
            InvalidArgumentError: A frame has no colours, or what the detector returns does not fit.
        """
        views = []
        for frame in frames:
            if frame.rgb is None:
                raise InvalidArgumentError("argument `frames`: one has no colours, expected frames rendered with them")
            views.append(DetectorView(frame.rgb, frame.depth_m, frame.pose.horizon_rad))
        found = self._detector.detect(views)
        if len(found) != len(views):
            raise InvalidArgumentError(f"a detector returned {len(found)} results for {len(views)} views")
        remaining = []
        for one, view in zip(found, views, strict=True):
            one.check((view.rgb.shape[0], view.rgb.shape[1]))
            remaining.append(filtered(one, self._filters))
        features: Sequence[NDArray[np.float32] | None] = [one.features for one in remaining]
        if self._embedder is not None:
            features = self._embedder.image_features([view.rgb for view in views], [one.boxes_px for one in remaining])
        return [
            Percept(self._detections(one, feature), frame.depth_m, frame.pose)
            for one, feature, frame in zip(remaining, features, frames, strict=True)
        ]

    def text_feature(self, text: str) -> NDArray[np.float32] | None:
        """Return the embedder's feature, if there is one."""
        return None if self._embedder is None else self._embedder.text_feature(text)

    def _detections(self, found: Found, features: NDArray[np.float32] | None) -> Detections:
        """Give each pixel one label; drop masks that smaller masks leave too few pixels of."""
        masks = one_label_a_pixel(found.masks)
        num = len(found)
        left_px = np.bincount(masks[masks >= 0], minlength=num)
        min_area_px = self._filters.min_area_px * self._filters.scale_of(masks.shape) ** 2
        is_large_enough = left_px >= np.minimum(np.maximum(min_area_px, 1.0), mask_areas_px(found.masks))
        if not is_large_enough.all():
            masks = one_label_a_pixel(found.masks[is_large_enough])
        labels = [label for label, is_large in zip(found.labels, is_large_enough.tolist(), strict=True) if is_large]
        return Detections(
            masks=masks,
            labels=tuple(TYPE_OF_WORD.get(label, label) for label in labels),
            confidences=found.confidences[is_large_enough],
            features=None if features is None else features[is_large_enough],
        )
