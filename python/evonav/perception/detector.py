"""Define a detector: views in; masks, boxes, words and confidences out. It knows nothing of the scene."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from evonav.errors import InvalidArgumentError


@dataclass(frozen=True, slots=True)
class DetectorView:
    """View of a frame for a detector."""

    rgb: NDArray[np.uint8]
    """`(H, W, 3)`."""
    depth_m: NDArray[np.float32]
    """`(H, W)` planar z, `inf` where nothing is; most detectors do without."""
    horizon_rad: float
    """Angle by which the camera looks down."""


@dataclass(frozen=True, slots=True)
class Found:
    """Detections in one image of `(H, W)`, in any order; masks may overlap."""

    masks: NDArray[np.bool_]
    """`(N, H, W)`."""
    boxes_px: NDArray[np.float32]
    """`(N, 4)` left, top, right, bottom."""
    labels: tuple[str, ...]
    """The detector's own words."""
    confidences: NDArray[np.float32]
    """`(N,)` in 0..1."""
    features: NDArray[np.float32] | None = None
    """`(N, D)` unit image features, where the detector has some."""

    def __len__(self) -> int:
        return len(self.labels)

    def taken(self, indices: Sequence[int] | NDArray[np.int64]) -> "Found":
        """Return some of the detections, in the order of `indices`."""
        chosen = np.asarray(indices, np.int64)
        return Found(
            masks=self.masks[chosen],
            boxes_px=self.boxes_px[chosen],
            labels=tuple(self.labels[index] for index in chosen),
            confidences=self.confidences[chosen],
            features=None if self.features is None else self.features[chosen],
        )

    def check(self, shape: tuple[int, int]) -> None:
        """Check shapes, dtypes and values.

        Args:
            shape: `(H, W)` of the image.

        Raises:
            InvalidArgumentError: An array does not fit; the message names it.
        """
        num = len(self.labels)
        fits = {
            "masks": self.masks.shape == (num, *shape) and self.masks.dtype == np.bool_,
            "boxes_px": self.boxes_px.shape == (num, 4) and bool(np.isfinite(self.boxes_px).all()),
            "confidences": self.confidences.shape == (num,) and bool(np.isfinite(self.confidences).all()),
            "features": self.features is None
            or (self.features.ndim == 2 and len(self.features) == num and bool(np.isfinite(self.features).all())),
        }
        for name, is_fit in fits.items():
            if not is_fit:
                array: NDArray[np.generic] = getattr(self, name)
                raise InvalidArgumentError(
                    f"a detector's `{name}` ({array.dtype} of {array.shape}) do not fit {num} labels and an image of "
                    f"{shape}, or are not finite: see `evonav.perception.detector.Found`"
                )


class Detector(Protocol):
    """Finds objects in views. It may be shared by the episodes of a process, so it keeps nothing between calls."""

    def detect(self, views: Sequence[DetectorView]) -> Sequence[Found]:
        """Detect objects in the views of a round, as one batch.

        Returns:
            One `Found` a view.
        """
        ...


class Embedder(Protocol):
    """Features of parts of images and of texts in one space (CLIP)."""

    def image_features(
        self, images: Sequence[NDArray[np.uint8]], boxes_px: Sequence[NDArray[np.float32]]
    ) -> Sequence[NDArray[np.float32]]:
        """Features of crops, all images as one batch.

        Args:
            images: Each `(H, W, 3)` RGB.
            boxes_px: Each `(N, 4)` left, top, right, bottom.

        Returns:
            Each `(N, D)`, of unit length.
        """
        ...

    def text_feature(self, text: str) -> NDArray[np.float32]:
        """`(D,)` of unit length."""
        ...
