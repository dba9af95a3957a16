"""Boxes from words, then masks from boxes: how open-vocabulary detectors and SAM are put together."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from evonav.perception.detector import DetectorView, Found


@dataclass(frozen=True, slots=True)
class Boxes:
    """Boxes in one image, without masks."""

    boxes_px: NDArray[np.float32]
    """`(N, 4)` left, top, right, bottom."""
    labels: tuple[str, ...]
    confidences: NDArray[np.float32]
    """`(N,)`."""


@dataclass(frozen=True, slots=True)
class Masks:
    """A mask for each box of an image."""

    masks: NDArray[np.bool_]
    """`(N, H, W)`."""
    scores: NDArray[np.float32]
    """`(N,)` how good the model takes its mask to be."""


class BoxFinder(Protocol):
    """Finds what words name."""

    def find(self, images: Sequence[NDArray[np.uint8]], phrases: tuple[str, ...], min_confidence: float) -> list[Boxes]:
        """Boxes of each `(H, W, 3)` RGB image; labels are among `phrases`, or phrases of them."""
        ...


class MaskMaker(Protocol):
    """Outlines what is in boxes."""

    def outline(self, images: Sequence[NDArray[np.uint8]], boxes_px: Sequence[NDArray[np.float32]]) -> list[Masks]:
        """Return as many masks as boxes `(N, 4)`, in their order, for each `(H, W, 3)` RGB image."""
        ...


@dataclass(frozen=True, slots=True)
class PromptedDetector:
    """A `Detector` of two models."""

    finder: BoxFinder
    masker: MaskMaker
    phrases: tuple[str, ...]
    min_confidence: float
    """Boxes below it get no mask."""
    min_mask_score: float = 0.0
    """Masks below it are dropped."""
    swaps_colours: bool = False
    """Both models are shown red as blue and blue as red."""

    def detect(self, views: Sequence[DetectorView]) -> list[Found]:
        """Boxes and masks of all views as one batch; depth is not looked at."""
        images = [view.rgb[..., ::-1] if self.swaps_colours else view.rgb for view in views]
        boxes = self.finder.find(images, self.phrases, self.min_confidence)
        masks = self.masker.outline(images, [one.boxes_px for one in boxes])
        return [
            Found(outlined.masks, some.boxes_px, some.labels, some.confidences).taken(
                np.flatnonzero(outlined.scores >= self.min_mask_score)
            )
            for some, outlined in zip(boxes, masks, strict=True)
        ]


def box_masks(boxes_px: NDArray[np.float32], shape: tuple[int, int]) -> NDArray[np.bool_]:
    """`(N, H, W)` boxes filled, for those of which a model makes no mask.

    Args:
        boxes_px: `(N, 4)` left, top, right, bottom.
        shape: `(H, W)` of the image.
    """
    masks = np.zeros((len(boxes_px), *shape), np.bool_)
    for mask, box in zip(masks, boxes_px, strict=True):
        left, top, right, bottom = np.clip(np.round(box), 0, [shape[1], shape[0], shape[1], shape[0]]).astype(int)
        mask[top:bottom, left:right] = True
    return masks
