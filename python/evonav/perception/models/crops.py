"""Compute features of parts of images."""

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from evonav.perception.models.libraries import imported

PADDING_PX = 20.0
"""Margin around a box, in 3D-Mem's images of 1280x1280; it is scaled with the image."""
BATCH = 64
"""Largest number of crops or texts that are encoded at once."""
_REFERENCE_PX = 1280.0


class CropEmbedder(ABC):
    """An `Embedder` of padded crops."""

    num_features: int
    """Number of values of a feature."""

    def image_features(
        self, images: Sequence[NDArray[np.uint8]], boxes_px: Sequence[NDArray[np.float32]]
    ) -> list[NDArray[np.float32]]:
        """Return unit features of padded crops, all images' in batches of 64."""
        torch = imported("torch")
        crops = [
            np.ascontiguousarray(crop)
            for image, boxes in zip(images, boxes_px, strict=True)
            for crop in padded_crops(image, boxes)
        ]
        rows = [np.zeros((0, self.num_features), np.float32)]
        with torch.inference_mode():
            rows += [self._encode(crops[start : start + BATCH]) for start in range(0, len(crops), BATCH)]
        features = unit(np.concatenate(rows))
        ends = np.cumsum([0, *(len(boxes) for boxes in boxes_px)]).tolist()
        return [features[start:end] for start, end in pairwise(ends)]

    @abstractmethod
    def _encode(self, crops: Sequence[NDArray[np.uint8]]) -> NDArray[np.float32]:
        """Return the features `(N, D)` of a batch of crops `(H, W, 3)`, of any length."""


def padded_crops(image: NDArray[np.uint8], boxes_px: NDArray[np.float32]) -> list[NDArray[np.uint8]]:
    """Cut out boxes and a little around them, never less than a pixel.

    Args:
        image: `(H, W, 3)`.
        boxes_px: `(N, 4)` left, top, right, bottom.
    """
    height_px, width_px = image.shape[:2]
    padding_px = PADDING_PX * math.sqrt(height_px * width_px) / _REFERENCE_PX
    crops = []
    for left, top, right, bottom in boxes_px.tolist():
        first_row = min(max(math.floor(top - padding_px), 0), height_px - 1)
        first_col = min(max(math.floor(left - padding_px), 0), width_px - 1)
        end_row = max(min(math.ceil(bottom + padding_px), height_px), first_row + 1)
        end_col = max(min(math.ceil(right + padding_px), width_px), first_col + 1)
        crops.append(image[first_row:end_row, first_col:end_col])
    return crops


def unit(features: NDArray[np.float32]) -> NDArray[np.float32]:
    """`(N, D)` features brought to length 1."""
    lengths = np.linalg.norm(features, axis=1, keepdims=True)
    return np.ascontiguousarray(features / np.maximum(lengths, 1e-12), np.float32)
