"""The mini detector: a small network of our own for the embedded simulator's pictures, run by the Rust core.

It needs no torch and no download. It knows the embedded simulator's pictures alone and stands for no published model:
its figures are never the paper's column. See docs/studies/mini-detector.md.
"""

import hashlib
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from evonav import _core
from evonav.errors import InvalidArgumentError
from evonav.perception.detector import DetectorView, Found
from evonav.perception.detector_perception import DetectorPerception
from evonav.perception.filters import FilterConfig

WEIGHTS = Path(__file__).parents[1] / "data" / "mini.weights"
"""Shipped weights, made by `scripts/mini_detector/train_mini.py` and `scripts/mini_detector/export_mini.py`."""


@cache
def _network(weights: Path) -> _core.MiniNetwork:
    """Return the network of a file of weights, read once a process."""
    try:
        return _core.MiniNetwork(weights.read_bytes())
    except (OSError, InvalidArgumentError) as error:
        raise InvalidArgumentError(
            f"the mini detector's weights {weights} cannot be used ({error}); reinstall evonav, or name a file that "
            "scripts/mini_detector/export_mini.py wrote"
        ) from error


class MiniPerception(DetectorPerception):
    """Perception `predicted:mini`. Its masks do not overlap, so only specks and doubtful ones are filtered."""

    def __init__(self, *, min_confidence: float = 0.3, min_cells: int = 2) -> None:
        """Make a perception with the shipped weights.

        Args:
            min_confidence: Least confidence of a detection, 0 to 1.
            min_cells: Fewest cells of an object, see `MiniDetector`.

        Raises:
            InvalidArgumentError: A parameter is outside its domain, or the weights are broken.
        """
        filters = FilterConfig(min_confidence=min_confidence, max_box_fraction=1.0, min_centre_distance_px=0.0)
        super().__init__(MiniDetector(min_confidence=min_confidence, min_cells=min_cells), filters)

    def check(self, agents: Sequence[str]) -> dict[str, Any]:
        """Return what decides results besides options: the checksum of the weights.

        Args:
            agents: Agents that will use it; they all see the same.
        """
        return {"mini": {WEIGHTS.name: hashlib.sha256(WEIGHTS.read_bytes()).hexdigest()}}


class MiniDetector:
    """Objects of the types in `classes`, from colours and depth together. Shared by all episodes of a process."""

    def __init__(self, weights: Path | None = None, *, min_cells: int = 2, min_confidence: float = 0.25) -> None:
        """Make a detector.

        Args:
            weights: A file of `scripts/mini_detector/export_mini.py`; default: what ships.
            min_cells: Fewest cells of an object, each of 4 by 4 pixels in a view of 300 by 300.
            min_confidence: Least mean probability of an object's type over its cells.

        Raises:
            InvalidArgumentError: The file is missing or broken, or a parameter is outside its domain.
        """
        if min_cells < 0 or not 0.0 <= min_confidence <= 1.0:
            raise InvalidArgumentError(
                f"mini: min_cells is {min_cells}, expected 0 or more; min_confidence {min_confidence}, expected 0..1"
            )
        self._network = _network(weights or WEIGHTS)
        self._min_cells = min_cells
        self._min_confidence = min_confidence
        self.classes = tuple(self._network.classes)
        """ProcTHOR's types that it tells apart."""

    def detect(self, views: Sequence[DetectorView]) -> list[Found]:
        """Detect objects in each view by itself: the number of views at once changes nothing.

        Args:
            views: Views of a camera of 90 degrees field of view.

        Returns:
            Instances, whose masks do not overlap.

        Raises:
            InvalidArgumentError: An image and its depths do not fit, or a depth or horizon is not a number.
        """
        return [self._found(view) for view in views]

    def _found(self, view: DetectorView) -> Found:
        numbers, classes, confidences = self._network.detect(
            np.ascontiguousarray(view.rgb),
            np.ascontiguousarray(view.depth_m),
            view.horizon_rad,
            min_cells=self._min_cells,
            min_confidence=self._min_confidence,
        )
        extents = _core.mask_extents(numbers, num_masks=len(classes))
        seen = np.flatnonzero(extents[:, 0] > 0)
        return Found(
            masks=numbers == seen[:, None, None],
            boxes_px=extents[seen, 1:].astype(np.float32),
            labels=tuple(self.classes[index] for index in classes[seen].tolist()),
            confidences=confidences[seen],
        )
