"""Computes statistics of pictures for `measure_pictures.py`: detail, luminance and saturation."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

EQUAL = 0.5
"""Grey levels by which neighbouring pixels may differ and are equal."""
EDGES = (0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 256.0)
"""Bounds of the gradient histogram, in grey levels."""
_LUMINANCE = np.array([0.299, 0.587, 0.114], np.float32)


@dataclass(frozen=True)
class PictureStatistics:
    """Means over some pictures, each counted alike."""

    num_pictures: int
    equal_neighbours: float
    """Share of pixels that equal the one on their right."""
    gradients: tuple[float, ...]
    """Share of the differences between horizontal neighbours in each interval of `EDGES`."""
    luminance: tuple[float, float]
    """Mean, and mean of the pictures' standard deviations, 0..255."""
    saturation: tuple[float, float]
    """The same of HSV's saturation, 0..1."""

    def as_json(self) -> dict[str, Any]:
        """Return everything by name."""
        return {
            "pictures": self.num_pictures,
            "equal_neighbours": self.equal_neighbours,
            "gradient_edges": EDGES,
            "gradients": self.gradients,
            "luminance_mean_spread": self.luminance,
            "saturation_mean_spread": self.saturation,
        }

    def rows(self) -> dict[str, float]:
        """Return the values by label."""
        bins = zip(EDGES, EDGES[1:], self.gradients, strict=False)
        return {
            "neighbours equal within half a grey level, share": self.equal_neighbours,
            **{f"differences of {low:g} to {high:g}, share": share for low, high, share in bins},
            "luminance, mean": self.luminance[0],
            "luminance, spread": self.luminance[1],
            "saturation, mean": self.saturation[0],
            "saturation, spread": self.saturation[1],
        }


def statistics_of(pictures: Sequence[NDArray[np.uint8]]) -> PictureStatistics:
    """Return the statistics of pictures `(H, W, 3)` of one size."""
    greys = [picture.astype(np.float32) @ _LUMINANCE for picture in pictures]
    steps = [np.abs(np.diff(grey, axis=1)).ravel() for grey in greys]
    # An interval holds its upper bound, so that the first one is what counts as equal.
    shares = [np.bincount(np.searchsorted(EDGES[1:], step), minlength=len(EDGES) - 1) / step.size for step in steps]
    saturations = [_saturation(picture) for picture in pictures]
    return PictureStatistics(
        num_pictures=len(pictures),
        equal_neighbours=float(np.mean([(step <= EQUAL).mean() for step in steps])),
        gradients=tuple(np.mean(shares, axis=0).tolist()),
        luminance=_mean_and_spread(greys),
        saturation=_mean_and_spread(saturations),
    )


def resized(picture: NDArray[np.uint8], side_px: int) -> NDArray[np.uint8]:
    """Return a picture at another size, each pixel the mean of those that it covers."""
    return np.asarray(Image.fromarray(picture).resize((side_px, side_px), Image.Resampling.BOX))


def _mean_and_spread(images: Sequence[NDArray[np.float32]]) -> tuple[float, float]:
    return float(np.mean([image.mean() for image in images])), float(np.mean([image.std() for image in images]))


def _saturation(picture: NDArray[np.uint8]) -> NDArray[np.float32]:
    high, low = picture.max(axis=2).astype(np.float32), picture.min(axis=2).astype(np.float32)
    saturation: NDArray[np.float32] = (high - low) / np.maximum(high, 1.0)
    return saturation
