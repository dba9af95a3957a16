"""Ultralytics (AGPL-3.0): boxes by YOLO-World, masks by SAM."""

import threading
from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evonav.perception.models.libraries import imported, loading, make_repeatable
from evonav.perception.models.open_clip_models import OpenClip, load_open_clip
from evonav.perception.models.prompted import Boxes, Masks, box_masks

_IMAGE_PX = 640
"""Side that YOLO-World looks at: the library's default, whatever the size of the views."""


class YoloWorld:
    """Boxes for any words. Their text features come from the CLIP it was trained with, through open_clip.

    The library itself would fetch a package from a git repository for that.
    """

    def __init__(self, model: Any, encoder: OpenClip, device: str) -> None:  # noqa: ANN401 - of ultralytics
        """Make a detector.

        Args:
            model: `ultralytics.YOLOWorld`.
            encoder: OpenAI's ViT-B/32.
        """
        self._model = model
        self._encoder = encoder
        self._device = device
        self._phrases: tuple[str, ...] | None = None
        self._features: dict[tuple[str, ...], Any] = {}
        self._lock = threading.Lock()

    def find(
        self,
        images: Sequence[NDArray[np.uint8]],
        phrases: tuple[str, ...],
        min_confidence: float,
    ) -> list[Boxes]:
        """Boxes of all images, as one batch."""
        with self._lock:  # words and images go in by two calls
            self._speak(phrases)
            results = self._model.predict(
                [_bgr(image) for image in images],
                conf=min_confidence,
                imgsz=_IMAGE_PX,
                device=self._device,
                verbose=False,
            )
        return [_boxes(result.boxes, phrases) for result in results]

    def _speak(self, phrases: tuple[str, ...]) -> None:
        """Set the words that the model looks for."""
        if phrases == self._phrases:
            return
        if phrases not in self._features:
            torch = imported("torch")
            features = np.array(self._encoder.text_features(phrases))
            self._features[phrases] = torch.from_numpy(features)[None].to(self._device)
        network = self._model.model
        network.txt_feats = self._features[phrases]
        network.model[-1].nc = len(phrases)
        network.names = list(phrases)
        self._model.predictor = None  # it has the old names
        self._phrases = phrases


class UltralyticsSam:
    """Masks from boxes."""

    def __init__(self, model: Any, device: str) -> None:  # noqa: ANN401 - of ultralytics
        """Make a segmenter.

        Args:
            model: `ultralytics.SAM`.
        """
        self._model = model
        self._device = device

    def outline(self, images: Sequence[NDArray[np.uint8]], boxes_px: Sequence[NDArray[np.float32]]) -> list[Masks]:
        """Segment one image after another: the library takes one set of boxes a call."""
        return [self._outline(image, boxes) for image, boxes in zip(images, boxes_px, strict=True)]

    def _outline(self, image: NDArray[np.uint8], boxes_px: NDArray[np.float32]) -> Masks:
        """Take the box itself where the model makes no mask or an empty one: it drops those that it scores 0."""
        masks = box_masks(boxes_px, (image.shape[0], image.shape[1]))
        scores = np.zeros(len(boxes_px), np.float32)
        if len(boxes_px) == 0:
            return Masks(masks, scores)
        (result,) = self._model.predict(_bgr(image), bboxes=boxes_px, conf=0.0, device=self._device, verbose=False)
        if result.masks is not None and result.boxes is not None:
            rows = result.boxes.cls.cpu().numpy().astype(np.int64)  # which box a mask is of
            for row, mask, score in zip(
                rows, result.masks.data.cpu().numpy().astype(np.bool_), result.boxes.conf.cpu().numpy(), strict=True
            ):
                scores[row] = score
                if mask.any():
                    masks[row] = mask
        return Masks(masks, scores)


@cache
def load_yolo_world(path: str, text_path: str, device: str) -> YoloWorld:
    """Return the detector of a file, loaded once a process.

    Args:
        path: `.pt`, or a `.yaml` of the library for random weights.
        text_path: Weights of OpenAI's ViT-B/32; empty: random ones.

    Raises:
        PerceptionError: The library is not installed, or the file is no such model.
    """
    ultralytics = imported("ultralytics")
    make_repeatable()
    encoder = load_open_clip("ViT-B-32-quickgelu", text_path, device)
    with loading(path, "YOLO-World"):
        model = ultralytics.YOLOWorld(path)
        model.to(device)
    return YoloWorld(model, encoder, device)


@cache
def load_ultralytics_sam(path: str, device: str) -> UltralyticsSam:
    """Return the segmenter of a file, loaded once a process.

    Args:
        path: Its name says which SAM it is: `sam_l.pt`, `sam_b.pt`, `mobile_sam.pt`.

    Raises:
        PerceptionError: The library is not installed, or the file is no such model.
    """
    ultralytics = imported("ultralytics")
    make_repeatable()
    with loading(path, "SAM"):
        model = ultralytics.SAM(path)
        model.to(device)
    return UltralyticsSam(model, device)


def _bgr(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return an image as the library takes arrays."""
    return np.ascontiguousarray(image[..., ::-1])


def _boxes(found: Any, phrases: tuple[str, ...]) -> Boxes:  # noqa: ANN401 - of ultralytics
    return Boxes(
        boxes_px=found.xyxy.cpu().numpy().astype(np.float32).reshape(-1, 4),
        labels=tuple(phrases[int(index)] for index in found.cls.cpu().numpy()),
        confidences=found.conf.cpu().numpy().astype(np.float32),
    )
