"""Torchvision (BSD-3-Clause): boxes and masks by Mask R-CNN."""

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evonav.perception.detector import Found
from evonav.perception.models.libraries import imported, loading, make_repeatable

_MIN_MASK = 0.5
"""Probability from which a pixel belongs to a mask."""


class MaskRcnn:
    """A network for COCO's categories."""

    def __init__(self, model: Any, categories: Sequence[str], device: str) -> None:  # noqa: ANN401 - of torchvision
        """Make a detector of a network.

        Args:
            model: Network of torchvision.
            categories: Names of its labels, by number.
        """
        self._model = model
        self._categories = tuple(categories)
        self._device = device

    def detect(
        self, images: Sequence[NDArray[np.uint8]], names_of: Mapping[str, str], min_confidence: float
    ) -> list[Found]:
        """Objects of some categories, all images as one batch.

        Args:
            images: Each `(H, W, 3)` RGB.
            names_of: Word for each category of interest.
            min_confidence: Least confidence of a detection.
        """
        torch = imported("torch")
        batch = [
            torch.from_numpy(np.ascontiguousarray(image)).permute(2, 0, 1).float().div(255.0).to(self._device)
            for image in images
        ]
        with torch.inference_mode():
            results = self._model(batch)
        return [self._found(result, names_of, min_confidence) for result in results]

    def _found(self, result: Mapping[str, Any], names_of: Mapping[str, str], min_confidence: float) -> Found:
        names = [self._categories[int(index)] for index in result["labels"].cpu()]
        scores = result["scores"].float().cpu().numpy()
        chosen = [index for index, name in enumerate(names) if name in names_of and scores[index] >= min_confidence]
        return Found(
            masks=(result["masks"][chosen, 0].cpu().numpy() >= _MIN_MASK),
            boxes_px=result["boxes"][chosen].float().cpu().numpy().astype(np.float32).reshape(-1, 4),
            labels=tuple(names_of[names[index]] for index in chosen),
            confidences=np.clip(scores[chosen], 0.0, 1.0).astype(np.float32),
        )


@cache
def load_mask_rcnn(path: str, device: str, min_score: float = 0.05) -> MaskRcnn:
    """Return the network of a file, loaded once a process.

    Args:
        path: File of its weights; empty: random ones.
        min_score: Limit below which the network itself drops detections.

    Raises:
        PerceptionError: The library is not installed, or the file is no such model.
    """
    detection, torch = imported("torchvision.models.detection"), imported("torch")
    make_repeatable()
    model = detection.maskrcnn_resnet50_fpn(weights=None, weights_backbone=None, box_score_thresh=min_score)
    if path:
        with loading(path, "Mask R-CNN"):
            model.load_state_dict(torch.load(path, map_location="cpu", weights_only=True))
    categories = detection.MaskRCNN_ResNet50_FPN_Weights.COCO_V1.meta["categories"]
    return MaskRcnn(model.eval().to(device), categories, device)
