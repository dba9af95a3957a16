"""Read and write the records of one perception on one task: a row per object in view, a row per detection, and sums.

A folder of `evonav perception` holds `perception.json`, the request, and `records/NAME/TASK.json.gz`.
"""

from pathlib import Path
from typing import Any

from evonav.drawing.svg import slug
from evonav.errors import StoreError
from evonav.report.measurements import MeasurementRecord, read_model

HEADER_NAME = "perception.json"
RECORD_DIR = "records"

DISTANCE_BINS_M = (0.0, 1.0, 2.0, 3.5, 6.0)
"""Lower edges of the bins; the last has no end. 3.5 m is as far as the paper's object memory takes detections."""
NUM_COSINE_BINS = 80
"""Number of bins of -1..1."""
NUM_CHECKPOINTS = 8
"""Number of times in a tour, evenly spaced, at which the memory is judged."""


class TrueRows(MeasurementRecord):
    """Wanted objects, one a view that shows it; all columns are as long."""

    stage: list[int] = []
    view: list[int] = []
    category: list[str] = []
    area_px: list[int] = []
    distance_m: list[float] = []
    outline_share: list[float] = []
    """Part of its outline that is cut by nothing nearer, nor by the image's border."""
    found: list[int] = []
    """Row of the detection with the right label, -1 without."""
    located: list[int] = []
    """Row of the detection at its place, whatever its label, -1 without."""


class DetectionRows(MeasurementRecord):
    """Detections; all columns are as long."""

    stage: list[int] = []
    view: list[int] = []
    label: list[str] = []
    confidence: list[float] = []
    area_px: list[int] = []
    distance_m: list[float | None] = []
    """Median depth in the mask, as perceived; `None` where it has none."""
    found: list[int] = []
    """Row of the object of its label, -1 without, -2 for an ignored one."""
    found_iou: list[float] = []
    """IoU with that object, also an ignored one."""
    located: list[int] = []
    """Row of the object at its place, whatever its label, -1 without, -2 for an ignored one."""
    located_iou: list[float] = []


class DepthSums(MeasurementRecord):
    """Sums over pixels by their true depth, in `DISTANCE_BINS_M`."""

    num: list[int] = [0] * len(DISTANCE_BINS_M)
    """Pixels with a true depth."""
    num_lost: list[int] = [0] * len(DISTANCE_BINS_M)
    """Pixels with a true depth but without a perceived one."""
    relative: list[float] = [0.0] * len(DISTANCE_BINS_M)
    """Sum of |error| over the true depth."""
    square_m2: list[float] = [0.0] * len(DISTANCE_BINS_M)
    """Sum of squared errors."""


class PoseRows(MeasurementRecord):
    """Errors of the believed pose, one a view."""

    offset_m: list[float] = []
    """Offsets on the ground plane."""
    turn_rad: list[float] = []
    """Errors of the yaw, without their sign."""


class FeatureSums(MeasurementRecord):
    """Counts of cosines, in `NUM_COSINE_BINS` of -1..1; empty where the perception has no features."""

    same_object: list[int] = []
    """Cosines of two detections of an object, from two views."""
    same_category: list[int] = []
    """Cosines of two objects of a category."""
    other: list[int] = []
    """Cosines of objects of two categories."""
    text_own: list[int] = []
    """Cosines of a detection and the word for its object's category."""
    text_other: list[int] = []
    """Cosines of a detection and the word for another category."""
    totals: dict[str, float] = {}
    """Sums of the same cosines, by name of the counts."""
    num_right: int = 0
    """Detections whose nearest word, of all categories seen, is their object's."""
    num_texts: int = 0
    """Detections compared with words."""


class MemoryState(MeasurementRecord):
    """The object map at one time, judged by the house of then (definitions: docs/perception.md)."""

    stage: int
    num_views: int
    """Views in this stage so far; 0: as the stage begins."""
    share: float
    """Share of the stage's tour."""
    num_entries: int
    num_right: int
    """An object of the entry's label stands within 0.3 m of its centre."""
    num_wrong_label: int
    """Entries with an object whose category is not their label."""
    num_phantoms: int
    """Most of the entry's detections were of no object."""
    num_objects: int
    """Different objects that entries were made of."""
    num_surplus: int
    """Entries beyond the first of each object."""
    num_seen: int
    """Objects that were in reach of the memory: wanted in a view, at most 3.5 m from the camera."""
    num_seen_held: int
    """Seen objects with a right entry."""
    num_stale: int = 0
    """Entries that were right at the end of the stage before and are not in this house."""
    error_m: float = 0.0
    """Sum over entries with an object of their label that stands where it was seen, from middle to middle."""
    num_error: int = 0


class TaskRecord(MeasurementRecord):
    """One perception on one task."""

    task_id: str
    digest: str
    """Digest of `task.json`."""
    house: str
    perception: str
    """The perception."""
    image_px: int
    """Pixels of an image."""
    stages: list[int]
    """Toured."""
    num_views: list[int]
    """Number of views in each of them."""
    truths: TrueRows
    detections: DetectionRows
    depth: DepthSums
    pose: PoseRows
    features: FeatureSums
    memory: list[MemoryState]
    picture: str | None = None
    """JPEG in base64: truth and detections of one view, side by side."""


class PerceptionHeader(MeasurementRecord):
    """Request that a folder was made for."""

    identity: dict[str, Any]
    """Settings that records of one folder share."""
    options: dict[str, dict[str, Any]]
    """Import path and keywords by perception, in the order in which they were first requested."""
    models: dict[str, dict[str, Any]] = {}
    """Hashes of weights and versions of libraries, by perception that has some."""
    tasks: list[str]
    """Tasks of the last command."""
    digests: dict[str, str]
    """Digests by task."""


def record_path(folder: Path, perception: str, task_id: str) -> Path:
    """Return the path of the record of a perception on a task."""
    return folder / RECORD_DIR / slug(perception) / f"{task_id}.json.gz"


def read_header(folder: Path) -> PerceptionHeader | None:
    """Return the header of a folder, `None` for a new one.

    Raises:
        StoreError: It cannot be read.
    """
    path = folder / HEADER_NAME
    return read_model(PerceptionHeader, path, "expected a header of `evonav perception`") if path.exists() else None


def read_records(folder: Path) -> dict[str, list[TaskRecord]]:
    """Read records by perception, of the tasks last requested that all of them have.

    Raises:
        StoreError: There is nothing, or a record cannot be read.
    """
    header = read_header(folder)
    if header is None:
        raise StoreError(f"{folder}: holds no {HEADER_NAME}; `evonav perception` makes one")
    tasks = complete_tasks(folder, header)
    return {
        perception: [
            read_model(TaskRecord, record_path(folder, perception, task), "delete it and run the command again")
            for task in tasks
        ]
        for perception in header.options
    }


def complete_tasks(folder: Path, header: PerceptionHeader) -> list[str]:
    """Return the tasks last requested that have a record of every perception."""
    names = header.options
    return [task for task in header.tasks if all(record_path(folder, name, task).exists() for name in names)]
