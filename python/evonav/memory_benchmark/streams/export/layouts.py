"""Name the files of an exported stream, and define what its text files hold."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal, TypeVar

from pydantic import Field, NonNegativeInt, PositiveFloat, PositiveInt, ValidationError

from evonav.errors import StoreError
from evonav.memory_benchmark.protocol import StreamInfo
from evonav.memory_benchmark.truth import TrueChange
from evonav.records import Record, Version, sentence_of
from evonav.world.simulator import Intrinsics, SceneObject

LayoutName = Literal["tum", "replica"]
STREAM_FILE = "stream.json"
FRAMES_FILE = "frames.jsonl"
ORACLE_FILE = "oracle.jsonl.xz"
CAMERA_FILE = "cam_params.json"
WORLD = "right-handed, metres, z up: X = x, Y = z, Z = y of evonav; OpenCV's camera"


@dataclass(frozen=True, slots=True)
class FileLayout:
    """The names of a layout's images, with the index of the frame, and its unit of depth."""

    rgb: str
    depth: str
    depth_scale: float
    """Number in the file for one metre."""


LAYOUTS: dict[LayoutName, FileLayout] = {
    "tum": FileLayout("rgb/{:06d}.png", "depth/{:06d}.png", 5000.0),
    "replica": FileLayout("results/frame{:06d}.jpg", "results/depth{:06d}.png", 6553.5),
}
"""TUM RGB-D's layout and unit; those of the rendered Replica that NICE-SLAM, ConceptGraphs and HOV-SG read."""
MASKS = "masks/{:06d}.png"
FEATURES = "features/{:06d}.npy"


class Camera(Record):
    """A pinhole camera, `camera` in `cam_params.json`: (0, 0) is the centre of the first pixel, as OpenCV counts."""

    w: PositiveInt
    h: PositiveInt
    fx: PositiveFloat
    fy: PositiveFloat
    cx: float
    cy: float
    scale: PositiveFloat = LAYOUTS["tum"].depth_scale
    """Number in depth images for one metre."""

    @staticmethod
    def of(camera: Intrinsics, scale: float) -> "Camera":
        """Return a camera of ours."""
        cx, cy = (camera.width_px - 1) / 2.0, (camera.height_px - 1) / 2.0
        focal_px = camera.focal_px
        return Camera(w=camera.width_px, h=camera.height_px, fx=focal_px, fy=focal_px, cx=cx, cy=cy, scale=scale)


class StreamFile(Record):
    """The public part of an exported stream, `stream.json`."""

    format: Version = 1
    name: str
    kind: str
    house: str
    digest: str
    """SHA-256 of the stream as it was before depth was rounded, see `evonav.memory_benchmark.truth.Digest`."""
    layout: LayoutName
    num_frames: NonNegativeInt
    depth_scale: PositiveFloat
    world: str = WORLD
    info: StreamInfo


class FrameLine(Record):
    """One line of `frames.jsonl`. Of a recording of one's own, only `depth` is needed."""

    index: NonNegativeInt = 0
    time_s: float = 0.0
    visit: PositiveInt = 1
    pose: tuple[float, float, float, float, float] | None = None
    """Pose of the camera in evonav's world: x, y, z, yaw and horizon."""
    rgb: str | None = None
    depth: str
    masks: str | None = None
    """Image with the index of the detection plus one at each pixel, 0 where none is."""
    features: str | None = None
    labels: tuple[str, ...] = ()
    confidences: tuple[Annotated[float, Field(ge=0.0, le=1.0)], ...] = ()


class OracleHead(Record):
    """The first line of the oracle's file."""

    name: str
    digest: str
    changes: tuple[TrueChange, ...]


class TruthLine(Record):
    """A further line of the oracle's file: the truth of one frame."""

    objects: tuple[SceneObject, ...] | None
    """Objects of the house; `None` if they are those of the frame before."""
    visible_px: dict[str, PositiveInt]
    empty_px: dict[NonNegativeInt, PositiveInt]
    detected_ids: tuple[str | None, ...]


R = TypeVar("R", bound=Record)


def record_of(kind: type[R], path: Path, text: str) -> R:
    """Return a record that is JSON in a file.

    Raises:
        StoreError: A field is wrong; the message names file, field and value.
    """
    try:
        return kind.model_validate_json(text)
    except ValidationError as error:
        raise StoreError(f"{path}: {sentence_of(error)}; it is in {text[:200]!r}") from error


def text_of(path: Path) -> str:
    """Return the text of a file.

    Raises:
        StoreError: It cannot be read.
    """
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise StoreError(f"{path}: cannot be read: {error}") from error


def read_camera(folder: Path) -> Camera:
    """Return the camera of a folder's `cam_params.json`.

    Raises:
        StoreError: The file is missing or malformed.
    """
    path = folder / CAMERA_FILE
    try:
        return Camera.model_validate(json.loads(text_of(path))["camera"])
    except (ValueError, KeyError, TypeError) as error:
        expected = ', expected {"camera": {"w", "h", "fx", "fy", "cx", "cy", "scale"}}'
        raise StoreError(f"{path}: cannot be read{expected}: {error}") from error


def read_frame_lines(folder: Path) -> list[FrameLine]:
    """Return the lines of a folder's `frames.jsonl`.

    Raises:
        StoreError: The file is missing, or a line is malformed.
    """
    path = folder / FRAMES_FILE
    return [record_of(FrameLine, path, text) for text in text_of(path).splitlines() if text.strip()]
