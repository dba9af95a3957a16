"""The mini detector: a small network of our own for the embedded simulator's pictures, run by the Rust core.

It needs no torch and no download. It knows the embedded simulator's pictures alone and stands for no published model:
its figures are never the paper's column. See docs/studies/mini-detector.md.
"""

import hashlib
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from evonav import _core
from evonav.errors import InvalidArgumentError
from evonav.perception.detector import DetectorView, Found
from evonav.perception.detector_perception import DetectorPerception
from evonav.perception.filters import FilterConfig
from evonav.records import Options, Share

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


class MiniConfig(Options):
    """Limits of the mini detector."""

    of = "predicted:mini"
    min_confidence: Share = 0.3
    """Least mean probability of an object's type over its cells."""
    min_cells: Annotated[int, Field(ge=0)] = 2
    """Fewest cells of an object, each of 4 by 4 pixels in a view of 300 by 300."""


def mini_perception(config: MiniConfig) -> DetectorPerception:
    """Make `predicted:mini` with the shipped weights; masks do not overlap, so only specks and doubts are filtered."""
    filters = FilterConfig(min_confidence=config.min_confidence, max_box_fraction=1.0, min_centre_distance_px=0.0)
    return DetectorPerception(MiniDetector(config), filters, facts_of=_facts_of)


def _facts_of(agents: Sequence[str]) -> dict[str, Any]:
    return {"mini": {WEIGHTS.name: hashlib.sha256(WEIGHTS.read_bytes()).hexdigest()}}


class MiniDetector:
    """Objects of the types in `classes`, from colours and depth together. Shared by all episodes of a process."""

    def __init__(self, config: MiniConfig | None = None, weights: Path = WEIGHTS) -> None:
        """Make a detector.

        Args:
            weights: A file of `scripts/mini_detector/export_mini.py`; default: what ships.

        Raises:
            InvalidArgumentError: The file is missing or broken.
        """
        self._network = _network(weights)
        self._config = config or MiniConfig()
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
            min_cells=self._config.min_cells,
            min_confidence=self._config.min_confidence,
        )
        extents = _core.mask_extents(numbers, num_masks=len(classes))
        seen = np.flatnonzero(extents[:, 0] > 0)
        return Found(
            masks=numbers == seen[:, None, None],
            boxes_px=extents[seen, 1:].astype(np.float32),
            labels=tuple(self.classes[index] for index in classes[seen].tolist()),
            confidences=confidences[seen],
        )
